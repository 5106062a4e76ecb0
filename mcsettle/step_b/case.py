"""One scenario as the engine sees it, and what became of its realisations."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from mcsettle.railway.irregularity import default_section, standard_deviation
from mcsettle.railway.scene import Scene
from mcsettle.railway.settlement_model import SettlementModel
from mcsettle.railway.traffic import Timetable
from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_b.mode_pairs import ModePairs, mode_pairs
from mcsettle.step_b.passage import mode_numbers


@dataclass(frozen=True)
class Case:
    """One scenario as the engine sees it, SI but for days.

    ``transfers``: one per service of the timetable. ``window`` m, ``sd_limit`` m, ``horizon`` days.
    ``multipliers`` [F, L] of each field of susceptibility in each track layer (None: the support does not
    vary); ``following`` [K] the part of the settlement that the rail follows (None: all of it).
    ``severity``: for each service what its axles count in each settlement group, [J, G] (None: 1).
    ``counted`` and ``settling``: for each service whether its axles advance the cycles N, and whether
    they settle the track (None: all do); a service that does neither is absent. The cycle jump alone
    takes them, and its days are then of traffic spread evenly over the day.
    """

    timetable: Timetable
    transfers: tuple[TransferFunctions, ...]
    model: SettlementModel
    window: float
    sd_limit: float
    horizon: float
    multipliers: np.ndarray | None = None
    following: np.ndarray | None = None
    severity: tuple[np.ndarray, ...] | None = None
    counted: tuple[bool, ...] | None = None
    settling: tuple[bool, ...] | None = None

    def __post_init__(self) -> None:
        n = len(self.timetable.services)
        if len(self.transfers) != n:
            raise ValueError("a case needs one set of transfer functions per service")
        for flags in (self.counted, self.settling):
            if flags is not None and (len(flags) != n or not any(flags)):
                raise ValueError(f"{flags} for {n} services; one flag each, and one of them set")

    @property
    def is_split(self) -> bool:
        """Whether some service only counts, only settles, or is absent."""
        return self.counted is not None or self.settling is not None

    @property
    def daily_passages(self) -> tuple[int, ...]:
        """Axle passages of each service in a day, none where it is absent."""
        services = self.timetable.services
        every = (True,) * len(services)
        flags = zip(services, self.counted or every, self.settling or every, strict=True)
        return tuple(s.per_day * s.train.n_axles if c or w else 0 for s, c, w in flags)

    @property
    def wavenumbers(self) -> np.ndarray:
        """Wavenumbers [K] rad/m of the profile's modes."""
        return self.transfers[0].wavenumbers

    @property
    def first_mode(self) -> int:
        """Mode number of the longest wave of the profile."""
        return int(mode_numbers(self.wavenumbers, self.window)[0])

    @property
    def mode_pairs(self) -> ModePairs:
        """Pairs of modes that together make a third; beside the band, too, where the support varies."""
        modes = mode_numbers(self.wavenumbers, self.window)
        return mode_pairs(modes, outer=len(self.group_multipliers) > 0)

    @property
    def group_multipliers(self) -> np.ndarray:
        """Multipliers [F, G] of the fields in the settlement groups; F may be 0."""
        groups = list(self.model.settling_layers)
        return (
            np.zeros((0, len(groups))) if self.multipliers is None else self.multipliers[:, groups]
        )

    @property
    def rail_follows(self) -> np.ndarray:
        """``following`` [K], ones where the rail follows fully."""
        return np.ones(len(self.wavenumbers)) if self.following is None else self.following


@dataclass(frozen=True)
class Support:
    """What tells the sections [R] of a batch apart beside their profiles: their support.

    ``fields`` complex [R, F, M] of susceptibility at modes 1 … M = 2 n_max, None where the support does
    not vary; ``factor`` [R] multiplies every settlement, None: 1.
    """

    fields: np.ndarray | None = None
    factor: np.ndarray | None = None

    def __getitem__(self, rows: np.ndarray | slice) -> "Support":
        """Some of them, or some of them again."""
        return Support(
            None if self.fields is None else self.fields[rows],
            None if self.factor is None else self.factor[rows],
        )


ALIKE = Support()  # sections that differ in their profiles alone


@dataclass(frozen=True)
class Outcome:
    """What became of R realisations; NaN days where the limit was not reached.

    ``days`` [R] fractional days to the limit; ``passages`` [R] axle passages simulated; ``sd_initial``
    and ``sd_final`` [R] m; ``amplitudes`` complex [R, K] m at the end; ``mean_settlement`` [R] m;
    ``history`` [R, H] m at the sample days (NaN after the stop); ``reached``, ``failed`` [R];
    ``steps`` [R] integration steps (cycle jump) or updates.
    """

    reached: np.ndarray
    failed: np.ndarray
    days: np.ndarray
    passages: np.ndarray
    sd_initial: np.ndarray
    sd_final: np.ndarray
    mean_settlement: np.ndarray
    amplitudes: np.ndarray
    history: np.ndarray
    steps: np.ndarray

    def intervals(self, horizon: float) -> tuple[np.ndarray, np.ndarray]:
        """Days to the limit and days censored at [R], one of them NaN; both where a track failed."""
        censored = np.where(self.reached | self.failed, np.nan, horizon)
        return np.where(self.failed, np.nan, self.days), censored


def support_of(
    scene: Scene, indices: Iterable[int], profiles: np.ndarray, tamping: int = 0
) -> Support:
    """Support of the realisations ``indices`` whose initial ``profiles`` are [R, K] m."""
    initial = standard_deviation(profiles, scene.wavenumbers, default_section(scene.window))
    return Support(*scene.support.sample(scene.profiles.seed, indices, initial, tamping))
