"""SDs of a line's sections carried on from a run, for every factor of a grid and three start SDs.

Step B carries on a section's measured profile; where only an SD is known, a random one of the study's
spectrum with that SD. Factors multiply the study's settlement factor. The start is measured no better
than the rest, so it takes three values: as measured, and √3 standard errors to either side
(Gauss–Hermite nodes).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mcsettle.railway.line_history import LineHistory
from mcsettle.railway.scene import Scene
from mcsettle.step_a.transfers import StepA
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.case import ALIKE, Support
from mcsettle.step_b.cycle_jump import CycleJump, Forms

COARSE = np.linspace(np.log(0.15), np.log(6.0), 15)  # log factors about the study's own, advanced
# And between them: SDs and 1/days are linear there.
FACTORS = np.linspace(COARSE[0], COARSE[-1], 85)
NODES = np.array([-np.sqrt(3.0), 0.0, np.sqrt(3.0)])  # standard errors of the start SD
NODE_WEIGHTS = np.array([1.0, 4.0, 1.0]) / 6.0
LEAST_START = 0.2  # of the SD measured
SAMPLES = 50  # days on which an SD is recorded, evenly in log(1 + day / 30)
ROWS = 20_000  # realisations advanced at a time: bounds the memory
TOLERANCE = 1e-4  # of a step, relative to the amplitudes: SDs within 0.001 mm of those at 1e-6
MOST_GROWN = 10.0  # times the largest SD: a track is followed no further
ABOVE = 8.0  # standard errors above limit and measurements a track is followed


def start_sds(history: LineHistory, rows: np.ndarray, start: int) -> np.ndarray:
    """SDs [P, N] m at run ``start``: as measured, and to either side."""
    sd = history.sd[rows, start]
    return np.maximum(sd[:, None] + NODES * history.sd_error, LEAST_START * sd[:, None])


def days_since_tamping(history: LineHistory, rows: np.ndarray, start: int) -> np.ndarray:
    """Days [P] from the tamping before run ``start`` to it; 0 where none is known."""
    tamped, day = history.tamped_on[rows, : start + 1], history.dates[start].toordinal()
    last = np.nanmax(np.where(np.isnan(tamped), -np.inf, tamped), axis=1)
    return np.where(np.isfinite(last), day - last, 0.0)


@dataclass(frozen=True, eq=False)
class SteppedCourses:
    """SDs of P sections from the start of a span on: ``days`` [H], ``sd`` [P, N, COARSE, H] m.

    Infinite where a track has left the range that matters.
    """

    days: np.ndarray
    sd: np.ndarray

    def on(self, day: np.ndarray) -> np.ndarray:
        """SD [P, N, F] m on ``day`` [P], linear between the days recorded."""
        at = np.clip(np.searchsorted(self.days, day), 1, len(self.days) - 1)
        share = (day - self.days[at - 1]) / (self.days[at] - self.days[at - 1])
        rows = np.arange(len(day))
        low, high = self.sd[rows, :, :, at - 1], self.sd[rows, :, :, at]
        weight = np.clip(share, 0.0, 1.0)[:, None, None]
        with np.errstate(invalid="ignore"):
            mixed = low + weight * (high - low)
        mixed = np.where(np.isfinite(high), mixed, np.where(weight == 0.0, low, np.inf))
        return between(mixed)

    def reaching(self, limit: np.ndarray) -> np.ndarray:
        """Days [P, N, F] from the start to the limit [P] m; inf where it is not reached."""
        above = self.sd >= limit[:, None, None, None]
        first = np.argmax(above, axis=-1)
        index = np.maximum(first, 1)[..., None]
        low = np.take_along_axis(self.sd, index - 1, axis=-1)[..., 0]
        high = np.take_along_axis(self.sd, index, axis=-1)[..., 0]
        days_low, days_high = self.days[index[..., 0] - 1], self.days[index[..., 0]]
        with np.errstate(invalid="ignore"):
            share = np.where(np.isfinite(high), (limit[:, None, None] - low) / (high - low), 1.0)
        reached = days_low + np.clip(share, 0.0, 1.0) * (days_high - days_low)
        reached = np.where(above.any(axis=-1), np.where(first == 0, 0.0, reached), np.inf)
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / between(1.0 / np.maximum(reached, 1e-3)))


def between(values: np.ndarray) -> np.ndarray:
    """Values [..., FACTORS] from those [..., COARSE], linear in the log factor; inf beside inf."""
    step = COARSE[1] - COARSE[0]
    low = np.minimum(((FACTORS - COARSE[0]) / step + 1e-9).astype(int), len(COARSE) - 2)
    share = (FACTORS - COARSE[low]) / step
    left, right = values[..., low], values[..., low + 1]
    with np.errstate(invalid="ignore"):
        mixed = left + share * (right - left)
    finite = np.isfinite(left) & np.isfinite(right)
    return np.where(share < 1e-6, left, np.where(finite, mixed, np.inf))


@dataclass(frozen=True, eq=False)
class SteppedGrowth:
    """Growth by Step B; ``scenes`` by (variant, scenario). ``forms`` of trains are kept between calls."""

    scenes: Mapping[tuple[str, str], Scene]
    prepared: StepA
    history: LineHistory
    forms: dict[tuple[str, str], Forms] = field(default_factory=dict)
    name: str = "model"
    logs: np.ndarray = field(default_factory=FACTORS.copy)

    def courses(self, rows: np.ndarray, start: int, horizon: float) -> SteppedCourses:
        """Courses of the sections ``rows`` [P] from run ``start`` on, over ``horizon`` days."""
        history = self.history
        days = 30.0 * np.expm1(np.linspace(0.0, np.log1p(horizon / 30.0), SAMPLES))
        sd = np.empty((len(rows), len(NODES), len(COARSE), SAMPLES), dtype=np.float32)
        top = np.nanmax(np.concatenate([history.sd[rows].ravel(), history.sd_limit[rows]]))
        top = 1.5 * top + ABOVE * history.sd_error
        for at, scene in self._kinds(rows):
            engine = self._engine(scene, top, 1.001 * horizon)
            profiles = start_profiles(scene, history, rows[at], start)
            per_batch = max(1, ROWS // (len(NODES) * len(COARSE)))
            for first in range(0, len(at), per_batch):
                part = at[first : first + per_batch]
                measured = profiles[first : first + per_batch]
                support = start_support(scene, history, rows[part], start)
                sd[part] = _advanced(engine, history, rows[part], start, measured, days, support)
        return SteppedCourses(days, sd)

    def carried(self, rows: np.ndarray, start: int, days: float, factors: np.ndarray) -> np.ndarray:
        """Amplitudes complex [P, K] m of the profiles of run ``start``, ``days`` later."""
        history = self.history
        top = MOST_GROWN * float(np.nanmax(history.sd[rows]))
        later = np.empty((len(rows), history.amplitudes.shape[2]), dtype=complex)
        for at, scene in self._kinds(rows):
            engine = self._engine(scene, top, days)
            profiles = start_profiles(scene, history, rows[at], start)
            support = start_support(scene, history, rows[at], start)
            age = days_since_tamping(history, rows[at], start)
            outcome = engine.run(profiles, np.zeros(0), factors[at], age, support, age)
            later[at] = outcome.amplitudes
        return later

    def _kinds(self, rows: np.ndarray) -> Iterator[tuple[np.ndarray, Scene]]:
        """Places among ``rows`` that share a scene."""
        kinds = list(zip(self.history.variant[rows], self.history.scenario[rows], strict=True))
        for kind in dict.fromkeys(kinds):
            at = np.array([place for place, other in enumerate(kinds) if other == kind])
            yield at, self.scenes[kind]

    def _engine(self, scene: Scene, top: float, horizon: float) -> CycleJump:
        """The engine of all sections of a scene."""
        case = replace(build_case(scene, self.prepared), sd_limit=top, horizon=horizon)
        forms = self.forms.setdefault((scene.variant, scene.scenario), {})
        return CycleJump(case, tolerance=TOLERANCE, forms=forms)


def start_profiles(scene: Scene, history: LineHistory, rows: np.ndarray, start: int) -> np.ndarray:
    """Amplitudes complex [P, K] m at run ``start``: as measured, else random of the spectrum."""
    profiles = history.amplitudes[rows, start]  # a copy
    for place in np.flatnonzero(np.isnan(profiles).any(axis=1)):
        row = int(rows[place])
        (profiles[place],) = scene.profiles.sample(range(row, row + 1))
    return profiles


def start_support(
    scene: Scene,
    history: LineHistory,
    rows: np.ndarray,
    start: int,
    gone: int = 0,
    address: Sequence[int] | None = None,
) -> Support:
    """Fields of the sections ``rows``, as many tampings old as they have lived through.

    ``gone`` tampings later they have what those draw anew from ``address`` [P]. What sections differ in
    as a whole is their factor, which is estimated.
    """
    if scene.support.settings is None:
        return ALIKE
    fields = []
    for place, row in enumerate(rows):
        sd, tamped = history.sd[row, [start]], int(history.spans[row, start])
        to_come = None if address is None else (tamped, [address[place]])
        of_row = scene.support.sample(scene.profiles.seed, [int(row)], sd, tamped + gone, to_come)[
            0
        ]
        assert of_row is not None
        fields.append(of_row)
    return Support(np.concatenate(fields))


def _advanced(
    engine: CycleJump,
    history: LineHistory,
    rows: np.ndarray,
    start: int,
    profiles: np.ndarray,
    days: np.ndarray,
    support: Support,
) -> np.ndarray:
    """SDs [P, N, COARSE, H] m of sections from ``profiles`` [P, K] scaled to each start SD."""
    starts = start_sds(history, rows, start)
    scaled = profiles * (1.0 / engine.measure.sd(profiles))[:, None]
    shape = (len(rows), len(NODES), len(COARSE))
    amplitudes = np.broadcast_to(
        (starts[:, :, None] * scaled[:, None, :])[:, :, None, :], (*shape, profiles.shape[1])
    ).reshape(-1, profiles.shape[1])
    factors = np.broadcast_to(np.exp(COARSE), shape).ravel()
    places = np.repeat(np.arange(len(rows)), shape[1] * shape[2])
    age = days_since_tamping(history, rows, start)[places]
    amplitudes = np.ascontiguousarray(amplitudes)
    history_of = engine.run(amplitudes, days, factors, age, support[places], age).history
    return np.where(np.isnan(history_of), np.inf, history_of).reshape(*shape, len(days))
