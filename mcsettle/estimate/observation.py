"""What was measured of a line, and what a model gives for it.

``Observation`` is one measurement; ``Course`` holds how the tracks of one scenario went, set by set, and
gives the number that a measurement is compared with.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

Quantity = Literal["sd", "settlement", "increment", "repetition"]


@dataclass(frozen=True)
class Observation:
    """What was measured of one section on a day, or a tamping interval: ``value``, standard ``error``.

    ``day`` after the start on which ``quantity`` was measured; None: ``value`` is an interval [days], the
    median of ``sections``. Quantities: "sd" [mm]; "settlement", uniform since the start [mm];
    "increment", SD [mm] of what the profile has changed by since then; "repetition", correlation of the
    increments of ``day`` days before and after a tamping that leaves a new profile. Observations of
    one ``section`` share its unknown track.
    """

    day: float | None
    value: float
    error: float
    scenario: str = ""
    section: str = ""
    sections: int = 1
    quantity: Quantity = "sd"

    @property
    def is_recorded(self) -> bool:
        """Whether the tables of a run have what it is compared with."""
        return self.is_interval or self.quantity == "sd"

    @property
    def is_interval(self) -> bool:
        """Whether a tamping interval was observed, and nothing on a day."""
        return self.day is None

    def beyond(self, horizon_days: float) -> str | None:
        """Why a model that ends at the horizon cannot be compared with it; None if it can."""
        latest = self.value if self.day is None else self.day
        if latest < horizon_days:
            return None
        return (
            f"received day {latest:g}; a realisation is followed for {horizon_days:g} days "
            "([limit] horizon_years): observe earlier, or set a later horizon"
        )


def by_section(observations: Iterable[Observation]) -> list[list[Observation]]:
    """Observations by section of line; the median of several sections stands alone."""
    groups: dict[str, list[Observation]] = {}
    medians = []
    for observation in observations:
        if observation.sections > 1:
            medians.append([observation])
        else:
            groups.setdefault(observation.section, []).append(observation)
    return [*groups.values(), *medians]


@dataclass(frozen=True)
class Course:
    """How the tracks of one scenario went, by parameter set and realisation.

    ``days`` [E, R] to the limit: inf where censored, NaN where failed. ``sampled`` [E, R, H] days on
    which the SD ``sd_mm`` [E, R, H] was recorded, rising, NaN after the last one of a track.
    """

    days: np.ndarray
    sampled: np.ndarray
    sd_mm: np.ndarray

    def first(self, n_tracks: int) -> "Course":
        """The first tracks alone."""
        return Course(*(part[:, :n_tracks] for part in (self.days, self.sampled, self.sd_mm)))

    def predicted(self, observation: Observation, stretch: np.ndarray | float = 0.0) -> np.ndarray:
        """Days or SDs [mm], [E, R], with all days of a set exp(``stretch`` [E]) times as long."""
        longer = np.reshape(np.exp(stretch), (-1, 1))
        if observation.day is None:
            return np.asarray(longer * self.days)
        return self.sd_on(observation.day / longer)

    def sd_on(self, day: np.ndarray | float) -> np.ndarray:
        """SD [E, R] mm on ``day`` (of each set: [E, 1]), linear between the days recorded.

        Beyond its last day (the limit) a track goes on as steeply as it came there: what is observed
        there was not tamped either. NaN where nothing was recorded.
        """
        count = np.sum(~np.isnan(self.sampled), axis=2)
        if not count.any():
            return np.full(count.shape, np.nan)
        day = np.broadcast_to(day, count.shape)
        last = np.maximum(count - 1, 0)
        start = np.sum(self.sampled <= day[..., None], axis=2) - 1
        start = np.clip(start, 0, np.maximum(last - 1, 0))
        (t0, sd0), (t1, sd1) = self._recorded(start), self._recorded(np.minimum(start + 1, last))
        end_day, end_sd = self._recorded(last)
        with np.errstate(invalid="ignore", divide="ignore"):
            slope = (sd1 - sd0) / (t1 - t0)
            sd = np.where(day > end_day, slope * (day - end_day) + end_sd, slope * (day - t0) + sd0)
        sd = np.where((day <= t0) | (last == 0), sd0, sd)
        return np.where(day == end_day, end_sd, sd)

    def _recorded(self, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Day and SD [E, R] of the recording at ``place`` [E, R]."""
        day, sd = (
            np.take_along_axis(part, place[..., None], axis=2)[..., 0]
            for part in (self.sampled, self.sd_mm)
        )
        return day, sd
