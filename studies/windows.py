"""What a passage costs as the window grows: the second-order form beside transforms, 200 m to 2 km.

The form's pairs of modes grow with the square of the window, a transform nearly in proportion to it. For
one axle they cross; for a whole train, which the form takes as one and a transform axle by axle, they do
not. Run on a quiet machine: ``python studies/windows.py``.
"""

import argparse
import time
from collections.abc import Callable

import numpy as np

from mcsettle.kernels import lanes, runtime
from mcsettle.railway.irregularity import sample_profiles, wavenumbers
from mcsettle.railway.settlement_model import SettlementModel
from mcsettle.railway.spectra import spectrum
from mcsettle.railway.track import TOY_TRACK
from mcsettle.railway.traffic import Train
from mcsettle.railway.vehicle import PASSENGER
from mcsettle.step_a.beam import beam_response
from mcsettle.step_a.interaction import precompute
from mcsettle.step_b.mode_pairs import mode_pairs
from mcsettle.step_b.passage import mode_numbers
from mcsettle.step_b.pointwise import pointwise_growth, pointwise_load
from mcsettle.step_b.settlement import cycle_increment
from mcsettle.step_b.spectral import axle_form, march_tables
from mcsettle.units import KMH

WINDOWS = (200.0, 400.0, 1000.0, 2000.0)
TRACKS, AXLES_OF_A_TRAIN = 256, 44


def main() -> None:
    """Measure every window and print one table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seconds", type=float, default=2.0)
    seconds = options.parse_args().seconds
    runtime.start()
    head = (
        "window",
        "modes",
        "pairs",
        "form, an axle",
        "transform, an axle",
        "form, a train of 44",
    )
    print("Microseconds of CPU a passage of one track\n")
    print("| " + " | ".join(head) + " |\n|" + "--|" * len(head))
    for window in WINDOWS:
        modes, pairs, form, transform = measured(window, seconds)
        cells = (f"{window:.0f} m", str(modes), str(pairs), f"{form:.3g}", f"{transform:.3g}",
                 f"{form / AXLES_OF_A_TRAIN:.3g}")  # fmt: skip
        print("| " + " | ".join(cells) + " |", flush=True)


def measured(window: float, seconds: float) -> tuple[int, int, float, float]:
    """Modes, pairs, and microseconds a passage by the form and by transforms."""
    k = wavenumbers(window)
    train = Train("passenger", (PASSENGER,))
    transfer = precompute(train, 201 * KMH, beam_response(TOY_TRACK), k)
    model = SettlementModel(tuple(layer.law for layer in TOY_TRACK.layers))
    tracks = sample_profiles(spectrum(), k, window, 1, range(TRACKS), sd=1.03e-3)
    growth = np.array([float(cycle_increment(law, 1e5, 1.0)) for law in model.group_laws])
    pairs = mode_pairs(mode_numbers(k, window))
    form = axle_form(transfer, 0, model, pairs)
    loads = form.packed(pairs.terms.order)[None], form.constant[None], form.mean[None]
    state = lanes.March(tracks, np.inf, march_tables(pairs), pairs.first, len(growth))
    n = max(1, int(2e5 / (len(pairs.sums) + len(pairs.differences))))
    updates = np.zeros(n, np.int32), np.tile(growth, (n, 1))
    by_form = spent(lambda: state.advance(*updates, *loads), seconds) / (n * TRACKS)
    load, axle = pointwise_load(transfer, model, window), np.zeros(1, np.int32)
    weights = np.tile(growth, (TRACKS, 1))
    by_transform = spent(lambda: pointwise_growth(load, axle, tracks, weights), seconds) / TRACKS
    n_pairs = len(pairs.sums) + len(pairs.differences)
    return len(k), n_pairs, 1e6 * by_form, 1e6 * by_transform


def spent(work: Callable[[], object], seconds: float) -> float:
    """Least CPU time of a call, s."""
    work()
    best, end = np.inf, time.perf_counter() + seconds
    while time.perf_counter() < end or best == np.inf:
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return best


if __name__ == "__main__":
    main()
