"""Which measurements of a line tell its factor, its variation and its memory apart.

Synthetic sites: a line whose settlement factor, coefficient of variation and correlation with the first
profile are drawn from their priors is measured on some of its sections, with errors; their posterior
follows by the likelihood of ``[[observed]]`` entries, every section's own track being unknown. Truths are
drawn from the prior, so that intervals of 90 % must cover 90 % of them whatever is measured; what a
measurement is worth is how far the intervals shrink.

    python studies/site_coverage.py [--sites 100] [--sets 64] [--tracks 24] [--sections 3]
"""

import argparse
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from mcsettle.estimate.likelihood import likelihood_of
from mcsettle.estimate.observation import Observation
from mcsettle.run.factor_model import FactorModel
from mcsettle.step_a.transfers import step_a
from mcsettle.study.study import Study

DAY = 365.0
FACTORS = np.log(np.geomspace(0.5, 20.0, 13))
CELLS = 161  # of the grid of factors
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


def predicted(cov: float, correlation: float, seed: int, n_tracks: int) -> dict[str, np.ndarray]:
    """What every quantity is, [F, R], at the factors ``FACTORS``."""
    study = study_of(cov, correlation, seed)
    scenes = list(study.scenes)
    entries = [Observation(DAY, 1.0, 1.0, scenes[0].scenario, quantity=q) for q in ERRORS]  # type: ignore[arg-type]
    model = FactorModel(scenes, step_a(scenes), entries)
    values = model.predicted(FACTORS, FACTORS, n_tracks)
    return dict(zip(ERRORS, values, strict=True))


def prior(rng: np.random.Generator, n: int) -> np.ndarray:
    """Coefficients of variation (log-uniform 0.05 to 0.4) and correlations (0 to 0.8), [n, 2]."""
    return np.column_stack(
        [np.exp(rng.uniform(np.log(0.05), np.log(0.4), n)), rng.uniform(0, 0.8, n)]
    )


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
    for name, default in (("sites", 100), ("sets", 64), ("tracks", 24), ("sections", 3)):
        parser.add_argument(f"--{name}", type=int, default=default)
    options = parser.parse_args()
    rng = np.random.default_rng(1)
    inputs = prior(rng, options.sets)
    sets = [predicted(*row, 1, options.tracks) for row in inputs]
    cells = np.linspace(FACTORS[0], FACTORS[-1], CELLS)
    grids = [
        {q: np.stack([np.interp(cells, FACTORS, c) for c in v.T], axis=1) for q, v in one.items()}
        for one in sets
    ]
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
