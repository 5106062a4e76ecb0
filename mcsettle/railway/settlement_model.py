"""How stress becomes settlement in one scenario: laws, what counts as stress, how cycles are counted."""

import math
from dataclasses import dataclass

from mcsettle.railway.track import BallastLaw, Law

STRESS_DEFINITIONS = ("traffic", "total")
CYCLE_COUNTS = ("shared", "per_vehicle", "equivalent")
HISTORIES = ("mix", "reference")


@dataclass(frozen=True)
class SettlementModel:
    """How stress becomes settlement in one scenario.

    ``laws``: one per track layer (None: the layer does not settle). ``stress``: "traffic" leaves the
    geostatic part out of σ_d, "total" keeps it. ``cycles``: "shared" counts one N for all vehicles,
    "per_vehicle" one for each train of the timetable, "equivalent" counts an axle as (its quasi-static
    σ_d over that of the reference)^n at each depth: ``equivalence_exponent`` n is a number or "law",
    m/b of the layer's own law (``ballast_equivalence_exponent`` where that is logarithmic);
    ``equivalence_history`` "reference": N before counts axles of the reference service, "mix": of the
    scenario's own day. ``long_run_cycles`` N_s: the cycle functions grow by ``long_run_strength`` times
    their slope at N_s in every cycle, besides. Cycle counts are axle passages; ``settlement_factor``
    multiplies every settlement increment.
    """

    laws: tuple[Law | None, ...]
    stress: str = "traffic"
    cycles: str = "shared"
    ballast_cycles_before: float = 1e5
    subgrade_cycles_before: float = 1e5
    cycles_per_passage: float = 1.0
    settlement_factor: float = 1.0
    equivalence_exponent: float | str | None = None
    ballast_equivalence_exponent: float | None = None
    equivalence_history: str | None = None
    long_run_cycles: float | None = None
    long_run_strength: float = 1.0

    def __post_init__(self) -> None:
        if self.stress not in STRESS_DEFINITIONS:
            raise ValueError(f"stress is '{self.stress}'; choose one of {STRESS_DEFINITIONS}")
        if self.cycles not in CYCLE_COUNTS:
            raise ValueError(f"cycles is '{self.cycles}'; choose one of {CYCLE_COUNTS}")
        if self.cycles == "equivalent":
            if self.equivalence_history not in HISTORIES:
                raise ValueError(f"equivalent cycles need a history, one of {HISTORIES}")
            for law in self.group_laws:
                self.exponent(law)
        if not any(self.laws):
            raise ValueError("no layer of the track has a settlement law")
        for name in ("ballast_cycles_before", "subgrade_cycles_before"):
            if not 1.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be at least 1")
        for name in ("cycles_per_passage", "settlement_factor"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be positive")

    @property
    def settling_layers(self) -> tuple[int, ...]:
        """Indices of the layers that have a law: the settlement groups, in order."""
        return tuple(i for i, law in enumerate(self.laws) if law is not None)

    @property
    def group_laws(self) -> tuple[Law, ...]:
        """The laws of the settlement groups."""
        return tuple(law for law in self.laws if law is not None)

    def exponent(self, law: Law) -> float:
        """Exponent n by which stress counts cycles in a layer of this law; 0: every axle counts alike.

        Raises
        ------
        ValueError
            The study gives none for this law.
        """
        if self.cycles != "equivalent":
            return 0.0
        n = self.equivalence_exponent
        if n == "law":
            n = self.ballast_equivalence_exponent if isinstance(law, BallastLaw) else law.m / law.b
        if not isinstance(n, int | float):
            raise ValueError("equivalent cycles need an exponent for every law")
        return float(n)

    def cycles_before(self, law: Law) -> float:
        """Cycles a layer of this law has seen at the start: since tamping, or since renewal."""
        is_ballast = isinstance(law, BallastLaw)
        return self.ballast_cycles_before if is_ballast else self.subgrade_cycles_before
