"""Run until a number is known well enough, or the time is up: batches that double.

Every batch is a run of its own with more realisations in the same folder, so the folder is that of a
plain run of the size reached, byte for byte, and goes on from there.
"""

import re
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from mcsettle.errors import InputError
from mcsettle.estimate.estimate import LEVELS, Estimate
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import Finished, run_study
from mcsettle.run.status import held_shards
from mcsettle.storage.location import Where, place
from mcsettle.study.study import Study
from mcsettle.summary.results import INTERVAL, read_results
from mcsettle.summary.summary import SummaryRow, summary_rows
from mcsettle.types import Progress, silent

FIRST_BATCH = 64
METRICS = {
    "tamping_interval": INTERVAL,
    "reduction": "reduction_percent",
    "elasticity": "elasticity",
    "marginal_cost": "marginal_cost",
    "sd_growth_1y": "sd_growth_1y_mm",
}
_QUANTILES = {"median": 0.5, **{f"p{round(100 * level)}": level for level in LEVELS}}
_TARGET = re.compile(r"\s*(\w+)\s+(\w+)\s+([0-9.]+)\s*%\s*$")


Run = Callable[[Study, Where, RunOptions, Progress], Finished]


@dataclass(frozen=True)
class Target:
    """A precision: the standard error of ``statistic`` of ``metric``, relative to its value.

    It is to hold in every variant and in every scenario that has the metric.
    """

    metric: str
    statistic: str
    tolerance: float

    def estimate(self, row: SummaryRow) -> Estimate | None:
        """The estimate that ``row`` has of the statistic; None where it has none."""
        level = _QUANTILES.get(self.statistic)
        names = ("quantile",) if level is not None else ("mean", "restricted_mean")
        fits = (s for s in row.statistics if s.statistic in names and s.level == level)
        return next((s.estimate for s in fits), None)


@dataclass(frozen=True)
class Batch:
    """How far a batch has come: the largest relative error and where; None: not identified."""

    realisations: int
    error: float | None
    where: str
    seconds: float


@dataclass(frozen=True)
class Stopped:
    """A run that was stopped: by the target (``met``), by the time (``late``) or at its cap."""

    finished: Finished
    batches: tuple[Batch, ...]
    met: bool
    late: bool


def parse_target(text: str) -> Target:
    """Target of a text such as "tamping_interval median 2%".

    Raises
    ------
    InputError
        It is not of this form, or names an unknown metric or statistic.

    Examples
    --------
    >>> parse_target("elasticity p95 5%")
    Target(metric='elasticity', statistic='p95', tolerance=0.05)
    """
    match = _TARGET.match(text)
    statistics = [*_QUANTILES, "mean"]
    metric = METRICS.get(match[1], match[1]) if match else ""
    if match is None or metric not in METRICS.values() or match[2] not in statistics:
        raise InputError(
            f'until= received "{text}"; it takes METRIC STATISTIC PERCENT, such as '
            f'"tamping_interval median 2%". Metrics: {", ".join(METRICS)}; statistics: '
            f"{', '.join(dict.fromkeys(statistics))}"
        )
    try:
        tolerance = float(match[3]) / 100.0
    except ValueError:
        tolerance = 0.0
    if not tolerance > 0.0:
        raise InputError(f'until= received "{text}"; the percentage must be positive')
    return Target(metric, match[2], tolerance)


def worst_error(rows: list[SummaryRow], target: Target) -> tuple[float | None, str]:
    """Largest relative standard error of the target's estimates, and where; None: unknown there.

    Raises
    ------
    InputError
        No row has the metric.
    """
    worst, where = -1.0, ""
    for row in rows:
        if row.metric == target.metric:
            estimate, name = target.estimate(row), f"{row.variant} {row.scenario}"
            error = None if estimate is None else estimate.relative_error
            if error is None:
                return None, name
            worst, where = max((worst, where), (error, name), key=lambda pair: pair[0])
    if worst < 0.0:
        raise InputError(f"until=: this study has no {target.metric} to estimate")
    return worst, where


def run_until(
    study: Study,
    out: Where,
    target: Target | None,
    max_minutes: float | None = None,
    options: RunOptions | None = None,
    progress: Progress = silent,
    tell: Callable[[Batch], object] = lambda _: None,
    clock: Callable[[], float] = time.monotonic,
    run: Run = run_study,
) -> Stopped:
    """Run in batches until ``target`` is met, the time is up or the sample is at its cap.

    Parameters
    ----------
    study, out, progress : as for ``run_study``
    target : precision to reach (None: none, only the time counts)
    max_minutes : no batch is begun that would probably end later; the first always runs
    options : as for ``run_study``; their realisations, or the study's, are the cap
    tell : called with every batch
    clock : seconds
    run : runs a batch: ``run_study``, or the like (``cluster.run_distributed`` for a scheduler)

    Raises
    ------
    InputError
        As ``run_study``, or the study does not have the target's metric.
    """
    options = options or RunOptions()
    cap = options.realisations or study.run.realisations
    start, batches = clock(), list[Batch]()
    sizes = _sizes(_held(out), cap)
    finished = run(study, out, replace(options, realisations=next(sizes)), progress)
    while True:
        spent = clock() - start - sum(b.seconds for b in batches)
        batches.append(_batch(out, target, spent))
        tell(batches[-1])
        error = batches[-1].error
        if target is not None and error is not None and error <= target.tolerance:
            return Stopped(finished, tuple(batches), True, False)
        size = next(sizes, None)
        if size is None:
            return Stopped(finished, tuple(batches), target is None, False)
        if max_minutes is not None and _ends(batches, size) > 60.0 * max_minutes:
            return Stopped(finished, tuple(batches), False, True)
        finished = run(study, out, replace(options, realisations=size), progress)


def _batch(out: Where, target: Target | None, seconds: float) -> Batch:
    """What the batch that stands in ``out`` has reached."""
    results = read_results(out)
    n = results.study.run.realisations
    if target is None:
        return Batch(n, None, "", seconds)
    error, where = worst_error(summary_rows(results), target)
    return Batch(n, error, where, seconds)


def _ends(batches: list[Batch], size: int) -> float:
    """Seconds from the start to the probable end of a batch of ``size``."""
    last, before = batches[-1], batches[-2].realisations if len(batches) > 1 else 0
    ahead = last.seconds * (size - last.realisations) / max(last.realisations - before, 1)
    return sum(b.seconds for b in batches) + ahead


def _sizes(held: int, cap: int) -> Iterator[int]:
    """Sample sizes: from what is there, or the first batch, doubling up to the cap."""
    n = held or FIRST_BATCH
    while n < cap:
        yield n
        n *= 2
    yield max(cap, held)


def _held(out: Where) -> int:
    """Realisations that a folder holds."""
    stems = (name.removesuffix(".parquet") for name in held_shards(place(out)))
    return max((int(stem[-8:]) + 1 for stem in stems if stem[-8:].isdigit()), default=0)
