"""How much of the load that a bent rail moves counts as the train's: an experiment with hanging sleepers.

A rail (per rail: EI, and the dead load of rail and half sleepers) lies on springs that push only, over a
support that has settled unevenly. Without a train the pad force varies by −EI k⁴ U already: that part is
no stress of the train's. What the train adds at x is the force under a wheel at x less the force there
without it: on springs that pull and push it is the same everywhere; where a sleeper hangs the wheel first
closes the gap, and the train has to press all that the dead load could not.

The share printed is the least-squares factor of −EI k⁴ U in the force that
the train adds ("traffic") and in the force under the wheel as it is ("total"), U the profile: the shape
of a rail that springs hold down everywhere, as the model has it.

Run: python studies/rail_bending.py [--profiles 3] [--every 1]
"""

import argparse
import itertools

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import splu

from mcsettle.railway.irregularity import sample_profiles, to_space, wavenumbers
from mcsettle.railway.spectra import spectrum
from mcsettle.railway.track import CASE_STUDY_TRACK

WINDOW, STEP = 200.0, 0.1  # m
WHEEL = 85e3  # N, a wheel of a 17 t axle
STIFFNESSES = (25e6, 50e6, 100e6)  # N/m² under one rail
DEAD_LOADS = (1.5e3, 3.0e3, 4.5e3)  # N/m: rail and half a sleeper every 0.65 m are some 3 kN/m
SDS = (1.03e-3, 2.4e-3)  # m
SHORTEST = (3.0, 6.0)  # m, of the waves that the profile has


def main() -> None:
    """Print one table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--profiles", type=int, default=3)
    options.add_argument("--every", type=float, default=1.0, help="m between wheel positions")
    given = options.parse_args()
    heads = [f"{kind}, {w:g}-35 m" for w in SHORTEST for kind in ("hangs", "traffic", "total")]
    print("| SD, mm | S, MN/m² | dead load, kN/m | " + " | ".join(heads) + " |")
    print("|" + "--|" * (3 + len(heads)))
    for sd, support, dead in itertools.product(SDS, STIFFNESSES, DEAD_LOADS):
        row = [f"{sd * 1e3:g}", f"{support / 1e6:g}", f"{dead / 1e3:g}"]
        for shortest in SHORTEST:
            runs = [
                experiment(sd, support, dead, shortest, i, given.every)
                for i in range(given.profiles)
            ]
            hangs, *shares = zip(*runs, strict=True)
            row.append(f"{np.mean(hangs):.0%}")
            row += [f"{np.mean(s):.2f} ({min(s):.2f} to {max(s):.2f})" for s in shares]
        print("| " + " | ".join(row) + " |", flush=True)


def experiment(
    sd: float, support: float, dead: float, shortest: float, index: int, every: float
) -> tuple[float, float, float]:
    """Part of the track that hangs, and the shares that "traffic" and "total" count.

    The profile has SD ``sd`` in 3-35 m; its waves below ``shortest`` are then left out.
    """
    bending = CASE_STUDY_TRACK.rail.bending_stiffness
    k, n = wavenumbers(WINDOW), round(WINDOW / STEP)
    x = np.arange(n) * STEP
    rail = sample_profiles(spectrum(), k, WINDOW, 1, [index], sd)
    rail = np.where(2.0 * np.pi / k > shortest * (1.0 - 1e-9), rail, 0.0)
    follows = support / (support + bending * k**4)
    settled = to_space(rail / follows, k, x)[0]
    beam = Beam(bending, support, n)
    free = beam.settle(settled, np.full(n, dead))
    before = support * np.maximum(free - settled, 0.0)
    wheels = np.arange(0, n, round(every / STEP))
    force, start = np.empty(len(wheels)), free
    for i, at in enumerate(wheels):
        load = np.full(n, dead)
        load[at] += WHEEL / STEP
        start = beam.settle(settled, load, start)
        force[i] = support * max(start[at] - settled[at], 0.0)
    moved = to_space(-bending * k**4 * rail, k, x[wheels])[0]
    shares = [float(np.dot(y - y.mean(), moved) / np.dot(moved, moved))
              for y in (force - before[wheels], force)]  # fmt: skip
    return float(np.mean(before == 0.0)), shares[0], shares[1]


class Beam:
    """A periodic beam of ``n`` points on springs that push only; SI, per metre of one rail."""

    def __init__(self, bending: float, support: float, n: int) -> None:
        stencil = bending / STEP**4 * np.array([1.0, -4.0, 6.0, -4.0, 1.0])
        offsets = [
            (o + d, v) for o, v in zip(range(-2, 3), stencil, strict=True) for d in (0, n, -n)
        ]
        diagonals = {o: v for o, v in offsets if -n < o < n}
        self.bending = sparse.diags(
            [np.full(n - abs(o), v) for o, v in diagonals.items()], list(diagonals), format="csc"
        )
        self.support = support

    def settle(
        self, settled: np.ndarray, load: np.ndarray, start: np.ndarray | None = None
    ) -> np.ndarray:
        """Deflection [n] m under ``load`` [n] N/m over a support at ``settled`` [n] m."""
        u = settled + load / self.support if start is None else start
        touches = u > settled
        for _ in range(100):
            springs = sparse.diags(self.support * touches, format="csc")
            u = splu((self.bending + springs).tocsc()).solve(
                load + self.support * touches * settled
            )
            after = u > settled
            if np.array_equal(after, touches):
                return u
            touches = after
        raise RuntimeError("the contact does not settle")


if __name__ == "__main__":
    main()
