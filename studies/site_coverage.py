"""Which measurements of a line tell its factor, its variation and its memory apart.

Synthetic sites: a line whose settlement factor, coefficient of variation and correlation with the first
profile are drawn from their priors is measured on some of its sections, with errors; their posterior
follows by the likelihood of ``[[observed]]`` entries, every section's own track being unknown. Truths are
drawn from the prior, so that intervals of 90 % must cover 90 % of them whatever is measured; what a
measurement is worth is how far the intervals shrink.

    python studies/site_coverage.py [--sites 100] [--tracks 24] [--sections 3]
"""

import argparse
import functools
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from mcsettle.estimate.likelihood import likelihood_of
from mcsettle.estimate.observation import Observation
from mcsettle.run.factor_model import FactorModel
from mcsettle.step_a.transfers import StepA, step_a
from mcsettle.study.study import Study

DAY = 365.0
FACTORS = np.log(np.geomspace(0.5, 20.0, 13))
CELLS = 61  # of the grid of factors
NODES = np.linspace(np.log(0.05), np.log(0.4), 6), np.linspace(0.0, 0.8, 4)  # log cov, correlation
BETWEEN = 17, 9  # of the grid that is interpolated
ERRORS = {"sd": 0.05, "settlement": 0.5, "increment": 0.05, "repetition": 0.1}  # mm, correlation
MEASURED = {
    "SD": ("sd",),
    "SD, levelling": ("sd", "settlement"),
    "SD, levelling, increments": ("sd", "settlement", "increment"),
    "SD, levelling, increments, repetition": ("sd", "settlement", "increment", "repetition"),
    "SD, increments, repetition": ("sd", "increment", "repetition"),
}


def study_of(cov: float, correlation: float, seed: int) -> Study:
    """The toy study's line, its support varying."""
    path = Path(__file__).with_name("toy.toml")
    data: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    for key in ("calibration", "economics"):
        data.pop(key, None)
    data["seed"], data["scenarios"] = seed, data["scenarios"][:1]
    data["spatial_variability"] = {
        "cov": cov,
        "correlation_length_m": 5.0,
        "distribution": "lognormal",
        "profile_correlation": correlation,
    }
    return Study.from_mapping(data)


@functools.cache
def track() -> StepA:
    """Step A of the line, the same for every support."""
    return step_a(study_of(0.1, 0.0, 1).scenes)


def predicted(cov: float, correlation: float, seed: int, n_tracks: int) -> dict[str, np.ndarray]:
    """What every quantity is, [F, R], at the factors ``FACTORS``."""
    study = study_of(cov, correlation, seed)
    scenes = list(study.scenes)
    entries = [Observation(DAY, 1.0, 1.0, scenes[0].scenario, quantity=q) for q in ERRORS]  # type: ignore[arg-type]
    model = FactorModel(scenes, track(), entries)
    values = model.predicted(FACTORS, FACTORS, n_tracks)
    return dict(zip(ERRORS, values, strict=True))


def prior(rng: np.random.Generator, n: int) -> np.ndarray:
    """Coefficients of variation (log-uniform 0.05 to 0.4) and correlations (0 to 0.8), [n, 2]."""
    return np.column_stack(
        [np.exp(rng.uniform(np.log(0.05), np.log(0.4), n)), rng.uniform(0, 0.8, n)]
    )


def interpolated(
    n_tracks: int, cells: np.ndarray
) -> tuple[np.ndarray, list[dict[str, np.ndarray]]]:
    """Inputs [S, 2] of a grid, and what every quantity is there, [C, R] at the factors ``cells``.

    The tracks are the same at every node, so that what becomes of one is smooth in the inputs.
    """
    nodes = [[predicted(np.exp(log), rho, 1, n_tracks) for rho in NODES[1]] for log in NODES[0]]
    fine = [np.linspace(n[0], n[-1], count) for n, count in zip(NODES, BETWEEN, strict=True)]
    points = np.array([(log, rho) for log in fine[0] for rho in fine[1]])
    tables = {}
    for quantity in ERRORS:
        values = np.array([[node[quantity] for node in row] for row in nodes])
        axes = (*NODES, FACTORS, np.arange(n_tracks))
        where = np.stack(
            np.broadcast_arrays(
                *(points[:, axis, None, None] for axis in (0, 1)),
                cells[None, :, None],
                np.arange(n_tracks)[None, None, :],
            ),
            axis=-1,
        )
        tables[quantity] = RegularGridInterpolator(axes, values)(where)
    grids = [{q: table[s] for q, table in tables.items()} for s in range(len(points))]
    return np.column_stack([np.exp(points[:, 0]), points[:, 1]]), grids


def between(table: np.ndarray, log: float) -> np.ndarray:
    """Values [R] at one log factor."""
    return np.array([np.interp(log, FACTORS, column) for column in table.T])


def quantile(values: np.ndarray, weights: np.ndarray, levels: tuple[float, ...]) -> np.ndarray:
    """Weighted quantiles."""
    order = np.argsort(values)
    cumulative = np.cumsum(weights[order]) / np.sum(weights)
    return values[order][np.searchsorted(cumulative, levels)]


def main() -> None:
    """Print, for every kind of measurement, coverage and width of the intervals."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    for name, default in (("sites", 100), ("tracks", 24), ("sections", 3)):
        parser.add_argument(f"--{name}", type=int, default=default)
    options = parser.parse_args()
    rng = np.random.default_rng(1)
    cells = np.linspace(FACTORS[0], FACTORS[-1], CELLS)
    inputs, grids = interpolated(options.tracks, cells)
    truths = prior(rng, options.sites)
    logs = rng.uniform(FACTORS[1], FACTORS[-2], options.sites)
    covered: dict[str, list[np.ndarray]] = {kind: [] for kind in MEASURED}
    widths: dict[str, list[np.ndarray]] = {kind: [] for kind in MEASURED}
    for site, (truth, log) in enumerate(zip(truths, logs, strict=True)):
        seen = predicted(*truth, 1000 + site, options.sections)
        values = {
            q: between(v, log) + ERRORS[q] * rng.normal(size=options.sections)
            for q, v in seen.items()
        }
        for kind, quantities in MEASURED.items():
            entries = [
                Observation(DAY, float(values[q][s]), ERRORS[q], "", str(s), quantity=q)  # type: ignore[arg-type]
                for q in quantities
                for s in range(options.sections)
            ]
            found = np.stack(
                [likelihood_of(entries, lambda o, g=grid: g[o.quantity]).plain() for grid in grids]
            )
            weights = np.exp(found - found.max())
            own = np.array([log, truth[0], truth[1]])
            sides = (cells, weights.sum(axis=0)), *((c, weights.sum(axis=1)) for c in inputs.T)
            bands = np.array([quantile(v, w, (0.05, 0.95)) for v, w in sides])
            covered[kind].append((bands[:, 0] <= own) & (own <= bands[:, 1]))
            widths[kind].append(bands[:, 1] - bands[:, 0])
    ends = np.array([FACTORS[-2] - FACTORS[1], 0.35, 0.8])
    whole = 0.9 * ends
    print("| measured | covers: factor | cov | correlation | width: factor | cov | correlation |")
    print("|--|--|--|--|--|--|--|")
    for kind in MEASURED:
        rates = np.mean(covered[kind], axis=0)
        narrow = np.median(widths[kind], axis=0) / whole
        cells_of = [f"{r:.0%}" for r in rates] + [f"{w:.2f}" for w in narrow]
        print(f"| {kind} | " + " | ".join(cells_of) + " |")


if __name__ == "__main__":
    main()
