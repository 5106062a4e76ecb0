"""Cycles of different loads as cycles of one: a case whose axles count by their stress, depth by depth.

Axle j counts ρ^n cycles at depth z, ρ its mean (quasi-static) σ_d over that of the reference. With D the
cycles counted so far (p for each passage) and a law of exponents m and b, one passage strains by

    Δε = A σ^m ρ^(−nb) D^b expm1(b log1p(p ρ^n / D)) = A (r σ)^m [φ(D + p ρ^n) − φ(D)] / ρ^n,
    r = ρ^(n(1−b)/m)                                            (the logarithm: b := 0),

so that the same engine serves: each depth is a settlement group of its own with its own count, stresses
are multiplied by r, and axles count ρ^n instead of 1. n = 0 counts every axle alike.
"""

from dataclasses import replace

import numpy as np

from mcsettle.railway.track import BallastLaw, Law
from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_b.case import Case
from mcsettle.step_b.stress import deviatoric_stress, mean_state

MOST = 1e6  # cycles that an axle counts without a remark


def with_equivalent_cycles(case: Case, reference: TransferFunctions | None) -> Case:
    """``case`` with its cycles counted as its model says.

    ``reference``: transfer functions of the reference service, whose axles count 1 on average; None
    where the count is of the scenario's own day (``equivalence_history`` "mix").
    """
    model = case.model
    if all(model.exponent(law) == 0.0 for law in model.group_laws):
        cycles = "shared" if model.cycles == "equivalent" else model.cycles
        return replace(case, model=replace(model, cycles=cycles))
    grid = case.transfers[0].grid
    laws = [model.laws[layer] for layer in grid.layer]
    exponents = np.array([0.0 if law is None else model.exponent(law) for law in laws])
    powers = [_mean_stress(t, model.stress) ** exponents for t in case.transfers]
    if reference is not None:
        one = (_mean_stress(reference, model.stress) ** exponents).mean(axis=0)
    else:
        axles = [(s.per_day, p) for s, p in zip(case.timetable.services, powers, strict=True)]
        one = sum(q * p.sum(axis=0) for q, p in axles) / sum(q * len(p) for q, p in axles)
    counts = [power / one for power in powers]
    settling = [z for z, law in enumerate(laws) if law is not None]
    scale = np.array([0.0 if law is None else _stress_exponent(law) for law in laws])
    transfers = tuple(
        _scaled(t, c**scale, model.stress) for t, c in zip(case.transfers, counts, strict=True)
    )
    multipliers = case.multipliers
    return replace(
        case,
        transfers=transfers,
        model=replace(model, laws=tuple(laws)),
        multipliers=None if multipliers is None else multipliers[:, grid.layer],
        severity=tuple(c[:, settling] for c in counts),
    )


def counting_remark(case: Case) -> str | None:
    """A remark on an axle that counts more than ``MOST`` cycles somewhere; None: none does."""
    largest = max(
        zip(case.severity or (), case.timetable.services, strict=False),
        key=lambda pair: float(pair[0].max()),
        default=None,
    )
    if largest is None or largest[0].max() <= MOST:
        return None
    counts, service = largest
    settling = [z for z, law in enumerate(case.model.laws) if law is not None]
    height = case.transfers[0].grid.z[settling][int(counts.max(axis=0).argmax())]
    return (
        f"an axle of '{service.train.name}' counts {counts.max():.3g} cycles at {height:.2f} m (0 m: the "
        "subgrade surface), which ages the layers within days; charges use exponents of 1.5 to 3 "
        "(settlement.equivalence_exponent)"
    )


def _mean_stress(transfer: TransferFunctions, stress: str) -> np.ndarray:
    """σ_d [J, Z] Pa under each axle, the profile left out."""
    state = mean_state(transfer.quasi_static, transfer.geostatic, stress)
    return deviatoric_stress(*np.moveaxis(state, 1, 0))


def _stress_exponent(law: Law) -> float:
    """Power (1 − b)/m of ρ^n by which the stress is multiplied."""
    b = 0.0 if isinstance(law, BallastLaw) else law.b
    return (1.0 - b) / law.exponent


def _scaled(transfer: TransferFunctions, ratio: np.ndarray, stress: str) -> TransferFunctions:
    """``transfer`` with stresses times ``ratio`` [J, Z]; every depth a layer."""
    state = mean_state(transfer.quasi_static, transfer.geostatic, stress)
    rest = state - transfer.quasi_static  # what ``mean_state`` adds
    grid = replace(transfer.grid, layer=np.arange(len(transfer.grid.layer)))
    return replace(
        transfer,
        grid=grid,
        quasi_static=state * ratio[:, None, :] - rest,
        dynamic=transfer.dynamic * ratio[:, None, None, :],
    )
