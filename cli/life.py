"""``mcsettle life``: what is printed and written of tracks that are tamped again and again."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mcsettle.cli.check import warn_of
from mcsettle.cli.marked_tables import write_tables
from mcsettle.cli.options import Force, Json, Realisations, StudyFile
from mcsettle.cli.study_file import study_in
from mcsettle.cli.tables import shown
from mcsettle.cli.terminal import Progress, checked_folder, cores, plainly, say_result
from mcsettle.estimate.rounding import with_error
from mcsettle.units import MM

if TYPE_CHECKING:
    import numpy as np

    from mcsettle.analysis.life import Life

LEVELS = (0.05, 0.5, 0.95)


@plainly
def life(
    study: StudyFile,
    out: Annotated[Path | None, typer.Option(help="Folder for tables (Parquet).")] = None,
    realisations: Realisations = None,
    json_output: Json = False,
    force: Force = False,
) -> None:
    """Tamp a study's tracks again and again to renewal; present and marginal cost beside Eq. (4).

    With [line], the sections of the line over the horizon: tampings and cost of each and of all.
    """
    from mcsettle.storage.marks import refuse_others

    loaded = study_in(study)
    if out is not None:
        checked_folder(out)
        names = ("lives", "tampings") if loaded.line is None else ("section_lives", "line_lives")
        refuse_others([out / f"{name}.parquet" for name in names], loaded.identity, force)
    warn_of(loaded)
    if loaded.line is not None:
        from mcsettle.cli.line_life import tell_line_life

        tell_line_life(loaded, realisations, out, json_output)
        return
    from mcsettle.analysis.life import lives as followed

    lives = followed(loaded, realisations, Progress(), cores())
    say_result(lives, json_output, life_data, life_lines)
    if out is not None:
        write_lives(lives, out, loaded.identity)


def life_lines(lives: Sequence["Life"]) -> Iterator[str]:
    """Present cost of the sequence and by Eq. (4), marginal costs, tampings of a life."""
    import numpy as np

    for life in lives:
        against = f" against {life.baseline}" if life.baseline else ""
        n_open = int(life.sequence.open.sum())
        followed = f", {n_open} of them followed no further (a lower bound)" if n_open else ""
        yield f"== {life.variant} {life.scenario}{against}: {len(life.cost)} realisations{followed}"
        yield f"{'':<34}{'mean ± s.e.':>20} {'P5':>10} {'P50':>10} {'P95':>10}"
        for text, values in _rows(life):
            n, mean, error, *quantiles = _numbers(values).values()
            if mean is not None:
                cells = " ".join(f"{shown(q, 5):>10}" for q in quantiles)
                some = "" if n == len(values) else f" (the {n} known of {len(values)})"
                yield f"{text:<34}{with_error(mean, error):>20} {cells}{some}"
            elif np.any(np.isinf(values)):
                yield f"{text:<34}{'–':>20} (without discounting it has no end)"
            elif n:
                yield f"{text:<34}{'–':>20} (known of {n} of {len(values)}, the shortest-lived)"
    units = dict.fromkeys(life.unit for life in lives if life.unit)
    yield f"Costs are {lives[0].currency}/track-km; marginal costs {', '.join(units) or 'are unknown'}."


def life_data(lives: Sequence["Life"]) -> list[dict[str, Any]]:
    """Means, errors and quantiles of every row, as JSON has them."""
    return [
        {
            "variant": life.variant,
            "scenario": life.scenario,
            "baseline": life.baseline,
            "realisations": len(life.cost),
            "open": int(life.sequence.open.sum()),
            "unit": life.unit,
            "currency": life.currency,
            "rows": {text: _numbers(values) for text, values in _rows(life)},
        }
        for life in lives
    ]


def write_lives(lives: Sequence["Life"], folder: Path, study: str) -> None:
    """Tables ``lives`` (a row for each track) and ``tampings`` (one for each tamping).

    ``study``: the mark that they bear.
    """
    import numpy as np
    import pandas as pd

    tracks: list[pd.DataFrame] = []
    tampings: dict[int, pd.DataFrame] = {}
    for life in lives:
        names = {"variant": life.variant, "scenario": life.scenario}
        columns = {
            "realisation": np.arange(len(life.cost)),
            "baseline": life.baseline,
            "currency": life.currency,
            "tampings": life.sequence.count.astype(int),
            "open": life.sequence.open,
            "present_cost_per_track_km": life.cost,
            "present_cost_eq4_per_track_km": life.constant,
            "marginal_cost": life.marginal,
            "marginal_cost_eq8_9": life.marginal_constant,
        }
        tracks.append(pd.DataFrame(names | columns))
        row, place = np.nonzero(~np.isnan(life.sequence.years))
        columns = {
            "realisation": row,
            "tamping": place + 1,
            "year": life.sequence.years[row, place],
            "sd_after_mm": life.sd_after[row, place] / MM,
        }
        # Against another baseline the tracks are the same, and are told once.
        tampings.setdefault(id(life.sequence), pd.DataFrame(names | columns))
    tables = {"lives": tracks, "tampings": tampings.values()}
    write_tables({k: pd.concat(v, ignore_index=True) for k, v in tables.items()}, folder, study)


def _rows(life: "Life") -> list[tuple[str, "np.ndarray"]]:
    import numpy as np

    years = np.concatenate([np.zeros((len(life.cost), 1)), life.sequence.years], axis=1)
    intervals = np.diff(years, axis=1)
    with np.errstate(invalid="ignore"):  # without discounting both are infinite
        ratio = life.cost / life.constant
    rows: list[tuple[str, Any]] = [
        ("present cost, this sequence", life.cost),
        ("present cost, Eq. (4)", life.constant),
        ("ratio of the two", ratio),
        ("first interval, years", intervals[:, 0]),
    ]
    if intervals.shape[1] > 1:
        rows.append(("second interval, years", intervals[:, 1]))
    if np.isfinite(life.sequence.life):
        rows.append(("tampings of a life", life.sequence.count.astype(float)))
    rows += [
        ("marginal cost, this sequence", life.marginal),
        ("marginal cost, Eqs. (8), (9)", life.marginal_constant),
    ]
    return rows


def _numbers(values: "np.ndarray") -> dict[str, Any]:
    """How many are known, their mean with its error, and their quantiles.

    None where a minority is known: it is that of the tracks that wear fastest.
    """
    import numpy as np

    finite = values[np.isfinite(values)]
    n = len(finite)
    numbers: list[float | None] = [None] * 5
    if n and 2 * n >= len(values):
        error = float(finite.std(ddof=1)) / math.sqrt(n) if n > 1 else None
        numbers = [float(finite.mean()), error, *np.quantile(finite, LEVELS).tolist()]
    keys = ("mean", "standard_error", "p5", "p50", "p95")
    return {"n": n} | dict(zip(keys, numbers, strict=True))
