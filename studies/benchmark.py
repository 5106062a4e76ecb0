"""Axle passages per second: the kernels beside NumPy, SciPy's FFT and Numba, same physics, one run.

Every design advances the same tracks by the same passages of the same 11-car passenger train on the
closed-form track; its error is that of the change of the profile over one train against the definition
(``mcsettle.step_b.passage``). The designs that are not ours are in ``baselines.py``. Run on a quiet
machine: ``make bench`` (options: realisations, seconds a design); ``MCSETTLE_RUNTIME=quadrants`` for the
kernels as that runtime compiles them. ``--both`` measures the kernels alone under both runtimes in turn,
a process each, and prints their ratios per CPU second, which other work on the machine changes little.
"""

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from baselines import (
    AXLES,
    WINDOW,
    definition,
    numba_lanes,
    numpy_fields,
    numpy_form,
    numpy_one,
    pairs_of,
    problem,
    scipy_low_rank,
    weights_of,
)

from mcsettle.kernels import backend, runtime
from mcsettle.railway.settlement_model import SettlementModel
from mcsettle.railway.spatial_variability import (
    SpatialVariability,
    field_waves,
    susceptibility,
)
from mcsettle.railway.spectra import spectrum
from mcsettle.railway.traffic import Service, Timetable, Train
from mcsettle.railway.vehicle import PASSENGER
from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_b.case import ALIKE, Case, Support
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.step_b.cycles import update_weights
from mcsettle.step_b.mode_pairs import mode_pairs
from mcsettle.step_b.passage import mode_numbers
from mcsettle.step_b.pointwise import pointwise_growth, pointwise_load
from mcsettle.step_b.stepwise import day_loads, pointwise_day_loads
from mcsettle.units import KMH


def main() -> None:
    """Measure every design and print one table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--realisations", type=int, default=1024)
    options.add_argument("--seconds", type=float, default=3.0)
    options.add_argument("--both", action="store_true", help="the kernels under both runtimes")
    options.add_argument("--rounds", type=int, default=3, help="with --both: processes of each")
    options.add_argument("--kernels", action="store_true", help="the kernels' rates alone, as JSON")
    given = options.parse_args()
    if given.both:
        both_runtimes(given.realisations, given.seconds, given.rounds)
        return
    runtime.start()
    transfer, model, tracks = problem(given.realisations)
    if given.kernels:
        print(json.dumps({n: per_cpu_second(n, transfer, model, tracks, given) for n in KERNELS}))
        return
    truth = definition(transfer, model, tracks[:1])
    peaks = {"f64": fused_peak("f64"), "f32": fused_peak("f32")}
    print(machine(), "\n")
    print(
        f"Fused multiply-adds on one core: f64 {gflops(peaks['f64'])}, f32 {gflops(peaks['f32'])}\n"
    )
    head = ("design", "passages/s", "CPU/wall", "per CPU second", "share of peak", "error")
    print("| " + " | ".join(head) + " |\n|" + "--|" * len(head))
    rates = {}
    for name, build in DESIGNS.items():
        try:
            advance, change = build(transfer, model, tracks)
        except ImportError as error:
            print(f"| {name} | not measured: {error} |" + " |" * (len(head) - 2))
            continue
        rate, busy = timed(advance, given.seconds)
        rates[name] = rate / busy
        share = FLOPS.get(name, 0.0) * rate / busy / peaks["f32" if "f32" in name else "f64"]
        cells = [
            f"{rate:.3g}",
            f"{busy:.2f}",
            f"{rate / busy:.3g}",
            f"{share:.0%}" if share else "",
        ]
        print(f"| {name} | " + " | ".join([*cells, deviation(change, truth)]) + " |", flush=True)
    cycle_jumps(transfer, model, tracks)
    print("\nRatios of rates per CPU second:\n")
    for ours in OURS:
        for other in OTHERS:
            if other in rates:
                print(f"- {ours}: {rates[ours] / rates[other]:.3g} × {other}")


def per_cpu_second(name, transfer, model, tracks, given) -> float:
    """Passages per CPU second of the design ``name``."""
    rate, busy = timed(DESIGNS[name](transfer, model, tracks)[0], given.seconds)
    return rate / busy


def both_runtimes(realisations: int, seconds: float, rounds: int) -> None:
    """Passages per CPU second of every kernel, the runtimes in turn, medians of ``rounds``."""
    found: dict[str, list[list[float]]] = {name: [] for name in backend.RUNTIMES}
    command = [sys.executable, __file__, "--kernels", f"--realisations={realisations}"]
    for _ in range(rounds):
        for name, rates in found.items():
            done = subprocess.run(
                [*command, f"--seconds={seconds}"],
                env=os.environ | {backend.VARIABLE: name},
                stdout=subprocess.PIPE,
                text=True,
                check=True,
            )
            rates.append(list(json.loads(done.stdout.splitlines()[-1]).values()))
    head = ("kernel", *(f"{name.title()}, per CPU second" for name in found), "ratio, every round")
    print("| " + " | ".join(head) + " |\n|" + "--|" * len(head))
    for at, kernel in enumerate(KERNELS):
        own = {name: [rates[at] for rates in rounds] for name, rounds in found.items()}
        ratios = [new / old for old, new in zip(*own.values(), strict=True)]
        cells = [f"{statistics.median(rates):.3g}" for rates in own.values()]
        cells += [f"{statistics.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})"]
        print(f"| {kernel.partition(', ')[2]} | " + " | ".join(cells) + " |")


def cycle_jumps(transfer: TransferFunctions, model: SettlementModel, tracks: np.ndarray) -> None:
    """CPU time per step of the cycle jump, the support uniform and varying along the track."""
    model = replace(model, settlement_factor=300.0)
    uniform = replace(one_service(transfer, model), sd_limit=1.5e-3, horizon=1e4)
    modes, n_layers = mode_numbers(transfer.wavenumbers, WINDOW), len(model.laws)
    print("\n| cycle jump | CPU µs per step of one track | times as long |\n|--|--|--|")
    first = None
    for name, independent in (
        ("uniform support", None),
        ("one field in all layers", False),
        ("a field in each layer", True),
    ):
        case, support = uniform, ALIKE
        if independent is not None:
            settings = SpatialVariability(
                0.2, 5.0, multipliers=(1.0,) * n_layers, independent=independent
            )
            waves = field_waves(settings, modes, WINDOW, spectrum())
            layers, indices = range(n_layers), range(len(tracks))
            support = Support(susceptibility(settings, waves, 1, indices, layers))
            case = replace(uniform, multipliers=settings.coupling(layers))
        engine = CycleJump(case)
        engine.run(tracks[:64], np.zeros(0), support=support[:64])  # compiled
        start = time.process_time()
        outcome = engine.run(tracks, np.zeros(0), support=support)
        spent = (time.process_time() - start) / outcome.steps.sum()
        first = first or spent
        print(f"| {name} | {spent * 1e6:.3g} | {spent / first:.3g} |", flush=True)


def deviation(change: np.ndarray | None, truth: np.ndarray) -> str:
    """Error of the change over a train, relative to its largest."""
    if change is None:
        return ""
    return f"{np.max(np.abs(change - truth)) / np.max(np.abs(truth)):.1e}"


def gflops(rate: float) -> str:
    """A rate of operations, in words."""
    return f"{rate / 1e9:.0f} GF/s" if np.isfinite(rate) else "not measured (needs numba)"


def fused_peak(precision: str) -> float:
    """Operations a second of independent fused multiply-adds on one core; inf without Numba."""
    try:
        import numba
    except ImportError:
        return np.inf

    @numba.njit(fastmath={"contract"})
    def four(v, a, b):
        return (((v * a + b) * a + b) * a + b) * a + b

    @numba.njit(fastmath={"contract"})
    def multiply_add(x, a, b, repeats):
        for _ in range(repeats):
            for i in range(x.size):  # sixteen that wait for each other; many i at a time
                x[i] = four(four(four(four(x[i], a, b), a, b), a, b), a, b)

    kind = {"f64": np.float64, "f32": np.float32}[precision]
    x, repeats, best = np.ones(512, kind), 20_000, 0.0
    multiply_add(x, kind(0.5), kind(0.25), 1)
    for _ in range(10):
        start = time.process_time()
        multiply_add(x, kind(0.5), kind(0.25), repeats)
        best = max(best, 32.0 * x.size * repeats / (time.process_time() - start))
    return best


def timed(advance: Callable[[], int], seconds: float) -> tuple[float, float]:
    """Best rate of passages per second of wall time, and CPU time over wall time of that call."""
    advance()
    best, busy, end = 0.0, 0.0, time.perf_counter() + seconds
    while time.perf_counter() < end or best == 0.0:
        wall, cpu = time.perf_counter(), time.process_time()
        done = advance()
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        if done / wall > best:
            best, busy = done / wall, cpu / wall
    return best, busy


def march_kernel(by_train: bool, precision: str = "f64"):
    """The production kernel: one update per axle, or one per train."""

    def build(transfer, model, tracks):
        case = one_service(transfer, model)
        pairs = pairs_of(transfer)
        loads = day_loads(case, pairs, by_train, precision)
        change = one_train(case, loads, tracks, by_train)
        state = loads.begin(tracks, 2.0)
        per_update, done = 44 if by_train else 1, [0]

        def advance() -> int:
            count = max(state.burst_size(), 4)
            updates = update_weights(case, loads.plan, done[0], count)
            state.advance(*updates, loads.form, loads.constant, loads.mean)
            done[0] += count
            return per_update * count * len(tracks)

        return advance, change

    return build


def one_train(case, loads, tracks, by_train):
    """Change over the first train of track 0, at weights of the first passage."""
    state = loads.begin(tracks[:1].copy(), 2.0)
    count = 1 if by_train else 44
    load, weights = update_weights(case, loads.plan, 0, count)
    state.advance(load, weights, loads.form, loads.constant, loads.mean)
    return state.amplitudes()[0] - tracks[0]


def pointwise_kernel(transfer, model, tracks):
    """Every x and depth, any exponent, a whole train at frozen profiles."""
    load = pointwise_load(transfer, model, WINDOW)
    w, axles = np.repeat(weights_of(model), len(tracks), axis=0), np.arange(load.n_axles)
    change = pointwise_growth(load, axles, tracks[:1], w[:1])[0][0]

    def advance() -> int:
        pointwise_growth(load, axles, tracks, w)
        return len(axles) * len(tracks)

    return advance, change


def pointwise_march(precision: str = "f64"):
    """Every x and depth, profiles updated after every axle."""

    def build(transfer, model, tracks):
        case = one_service(transfer, model)
        loads = pointwise_day_loads(case, precision)
        first = loads.begin(tracks[:1], 2.0)
        first.advance(*update_weights(case, loads.plan, 0, AXLES))
        change = first.amplitudes()[0] - tracks[0]
        state, done = loads.begin(tracks, 2.0), [0]

        def advance() -> int:
            count = state.burst_size()
            state.advance(*update_weights(case, loads.plan, done[0], count))
            done[0] += count
            return count * len(tracks)

        return advance, change

    return build


def one_service(transfer: TransferFunctions, model: SettlementModel) -> Case:
    """Seventy-two trains a day, far from any limit."""
    service = Service(Train("passenger", (PASSENGER,) * 11), 201 * KMH, 72)
    return Case(Timetable((service,)), (transfer,), model, WINDOW, 1.0, 1e9)


OWN = backend.NAME.title()
DESIGNS = {
    "NumPy, the definition, one realisation": numpy_one,
    "NumPy, every field by FFT, one realisation": numpy_fields,
    "NumPy, second-order form, 64 realisations": numpy_form,
    "SciPy FFT, the same mathematics, 64 realisations": scipy_low_rank,
    "Numba, second-order form, lanes": numba_lanes,
    f"{OWN}, every x and depth, profile fixed over a train": pointwise_kernel,
    f"{OWN}, every x and depth, every axle": pointwise_march(),
    f"{OWN}, every x and depth, every axle, f32": pointwise_march("f32"),
    f"{OWN}, second-order form, every axle": march_kernel(by_train=False),
    f"{OWN}, second-order form, every axle, f32": march_kernel(by_train=False, precision="f32"),
    f"{OWN}, second-order form, every train": march_kernel(by_train=True),
    f"{OWN}, second-order form, every train, f32": march_kernel(by_train=True, precision="f32"),
}
KERNELS = list(DESIGNS)[5:]
OURS = list(DESIGNS)[6:10]
OTHERS = list(DESIGNS)[1:5]
# Of a passage: 20 for each mode, 14 for each pair; ours 24 for two pairs that share a mode.
BAND = np.arange(6, 67)
TERMS = mode_pairs(BAND).terms
FLOPS = dict.fromkeys(
    list(DESIGNS)[8:10], 20 * len(BAND) + 24 * len(TERMS.joined) + 14 * len(TERMS.single)
)
FLOPS[list(DESIGNS)[4]] = 20 * len(BAND) + 14 * len(TERMS.order)


def machine() -> str:
    """One line on the machine and what dense products reach on it."""
    a = np.random.default_rng(0).standard_normal((1024, 1024))
    rates = []
    for _ in range(5):
        start = time.process_time()
        a @ a
        rates.append(2 * 1024**3 / (time.process_time() - start) / 1e9)
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    models = [line.split(":")[1].strip() for line in lines if "model name" in line]
    threads = os.environ.get("OPENBLAS_NUM_THREADS", "all")
    product = f"f64 matrix product {max(rates):.0f} GF/s per CPU second ({threads} BLAS threads)"
    return f"{(models or [platform.processor()])[0]}, {os.cpu_count()} cores; {product}"


if __name__ == "__main__":
    main()
