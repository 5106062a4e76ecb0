"""What the pictures of a finished run show: plain arrays, one description a line, bar or panel.

Depends on: nothing of the package.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Fan:
    """SD in time of one scenario: ``days`` [D]; ``quantiles`` [5, D] mm at P5, P25, P50, P75, P95.

    A tamped track stays at the limit. ``mgt_per_day`` turns days into tonnage.
    """

    label: str
    days: np.ndarray
    quantiles: np.ndarray
    mgt_per_day: float


@dataclass(frozen=True)
class Survival:
    """Share of tracks not yet tamped: steps at ``days`` [n] to ``share`` [n] with its 95 % band.

    ``end`` [days] is how far the tracks were followed; ``published`` [days] an interval to set beside.
    """

    label: str
    days: np.ndarray
    share: np.ndarray
    low: np.ndarray
    high: np.ndarray
    end: float
    published: float | None = None


@dataclass(frozen=True)
class Spread:
    """Quantiles of one quantity in one scenario: P5, P25, P50, P75, P95 (None: nothing known).

    ``curve`` [2, n]: values and density, for a picture of the whole distribution.
    """

    label: str
    quantiles: tuple[float, ...] | None
    published: float | None = None
    curve: np.ndarray | None = None


@dataclass(frozen=True)
class Rate:
    """Rate of change of the SD of one scenario in time: ``days`` [D], ``rate`` [3, D] mm/year."""

    label: str
    days: np.ndarray
    rate: np.ndarray


@dataclass(frozen=True)
class Profile:
    """One track along ``x`` [X] m: ``initial`` and ``final`` [X] mm in the band, ``days`` it took."""

    label: str
    x: np.ndarray
    initial: np.ndarray
    final: np.ndarray
    days: float | None


@dataclass(frozen=True)
class MixedDays:
    """SD of one track within a few days of mixed traffic, and which train ran when.

    ``days`` [D], ``sd`` [D] mm; ``blocks``: name, first and last day of every run of one service.
    """

    days: np.ndarray
    sd: np.ndarray
    blocks: tuple[tuple[str, float, float], ...]


@dataclass(frozen=True)
class Convergence:
    """A median with its 95 % interval as the sample grows: all [n]."""

    label: str
    counts: np.ndarray
    value: np.ndarray
    low: np.ndarray
    high: np.ndarray


@dataclass(frozen=True)
class Swing:
    """What one input does to one number: ``low`` and ``high`` end, or a share with its ``error``."""

    label: str
    low: float
    high: float
    error: float = 0.0
