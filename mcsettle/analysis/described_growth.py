"""Growth as it is described by hand, beside Step B: the SD rises with a power of time.

    SD(t) = SD₀ + r [(a + t)^q − a^q],

t years since a run, a those from the tamping before it (0 where none is known), q = 1 straight growth
and q = ½ growth with the root of time. Every section has a rate r of its own.
"""

from dataclasses import dataclass, field

import numpy as np

from mcsettle.analysis.growth_courses import (
    SteppedCourses,
    SteppedGrowth,
    days_since_tamping,
    start_sds,
)
from mcsettle.railway.line_history import LineHistory
from mcsettle.units import DAYS_PER_YEAR

# m per year^q: from what nobody could measure in ten years to what is tamped every month.
RATES = np.linspace(np.log(3e-6), np.log(1e-2), 160)


@dataclass(frozen=True, eq=False)
class DescribedCourses:
    """Courses from ``starts`` [P, N] m, ``age`` [P] years after a tamping; rates [F] m/year^``power``."""

    starts: np.ndarray
    age: np.ndarray
    rates: np.ndarray
    power: float

    def on(self, day: np.ndarray) -> np.ndarray:
        """SD [P, N, F] m on ``day`` [P] after the run."""
        years = np.maximum(day, 0.0) / DAYS_PER_YEAR
        grown = (self.age + years) ** self.power - self.age**self.power
        return self.starts[:, :, None] + grown[:, None, None] * self.rates

    def reaching(self, limit: np.ndarray) -> np.ndarray:
        """Days [P, N, F] from the run to the SD ``limit`` [P] m."""
        left = np.maximum(limit[:, None] - self.starts, 0.0)[:, :, None] / self.rates
        age = self.age[:, None, None]
        years = (left + age**self.power) ** (1.0 / self.power) - age
        return np.where(left > 0.0, years * DAYS_PER_YEAR, 0.0)


@dataclass(frozen=True, eq=False)
class DescribedGrowth:
    """Growth with time to the ``power`` q, by hand; ``logs`` [F] of its rates, equally spaced."""

    name: str
    power: float
    history: LineHistory
    logs: np.ndarray = field(default_factory=RATES.copy)

    def courses(self, rows: np.ndarray, start: int, horizon: float) -> DescribedCourses:
        """Courses of the sections ``rows`` [P] from run ``start`` on."""
        age = days_since_tamping(self.history, rows, start) / DAYS_PER_YEAR
        return DescribedCourses(
            start_sds(self.history, rows, start), age, np.exp(self.logs), self.power
        )


Courses = SteppedCourses | DescribedCourses
Growth = SteppedGrowth | DescribedGrowth


def by_hand(history: LineHistory) -> tuple[DescribedGrowth, ...]:
    """The forms that stand beside Step B."""
    return (
        DescribedGrowth("straight", 1.0, history),
        DescribedGrowth("root of time", 0.5, history),
    )
