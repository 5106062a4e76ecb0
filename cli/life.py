"""``mcsettle life``: what is printed and written of tracks that are tamped again and again."""

import json
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
from mcsettle.cli.terminal import Progress, checked_folder, cores, plainly, say
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
    from mcsettle.analysis.life import lives

    found = lives(loaded, realisations, Progress(), cores())
    say(life_json(found) if json_output else "\n".join(life_lines(found)), json_output)
    if out is not None:
        write_lives(found, out, loaded.identity)


def life_lines(found: Sequence["Life"]) -> Iterator[str]:
    """Present cost of the sequence and by Eq. (4), marginal costs, tampings of a life."""
    import numpy as np

    for life in found:
        against = f" against {life.baseline}" if life.baseline else ""
        yield f"== {life.variant} {life.scenario}{against}: {len(life.cost)} realisations{_open(life)}"
        yield f"{'':<34}{'mean ± s.e.':>20} {'P5':>10} {'P50':>10} {'P95':>10}"
        for text, values in _rows(life):
            known = values[np.isfinite(values)]
            if _of_most(known, values):
                part = (
                    ""
                    if len(known) == len(values)
                    else f" (the {len(known)} known of {len(values)})"
                )
                yield _line(text, known) + part
            elif np.any(np.isinf(values)):
                yield f"{text:<34}{'–':>20} (without discounting it has no end)"
            elif len(known):
                yield f"{text:<34}{'–':>20} (known of {len(known)} of {len(values)}, the shortest-lived)"
    units = dict.fromkeys(life.unit for life in found if life.unit)
    yield f"Costs are {found[0].currency}/track-km; marginal costs {', '.join(units) or 'are unknown'}."


def life_json(found: Sequence["Life"]) -> str:
    """Means, errors and quantiles of every row, as JSON."""
    data = [
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
        for life in found
    ]
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False)


def write_lives(found: Sequence["Life"], folder: Path, study: str) -> None:
    """Tables ``lives`` (a row for each track) and ``tampings`` (one for each tamping).

    ``study``: the mark that they bear.
    """
    import numpy as np
    import pandas as pd

    lives, tampings, followed = [], [], set[int]()
    for life in found:
        own = {"variant": life.variant, "scenario": life.scenario}
        for r in range(len(life.cost)):
            lives.append(
                own
                | {
                    "realisation": r,
                    "baseline": life.baseline,
                    "currency": life.currency,
                    "tampings": int(life.sequence.count[r]),
                    "open": bool(life.sequence.open[r]),
                    "present_cost_per_track_km": life.cost[r],
                    "present_cost_eq4_per_track_km": life.constant[r],
                    "marginal_cost": life.marginal[r],
                    "marginal_cost_eq8_9": life.marginal_constant[r],
                }
            )
        if id(life.sequence) in followed:
            continue  # the same tracks against another baseline
        followed.add(id(life.sequence))
        for r, c in zip(*np.nonzero(~np.isnan(life.sequence.years)), strict=True):
            tampings.append(
                own
                | {
                    "realisation": int(r),
                    "tamping": int(c) + 1,
                    "year": life.sequence.years[r, c],
                    "sd_after_mm": life.sd_after[r, c] / MM,
                }
            )
    tables = {"lives": pd.DataFrame(lives), "tampings": pd.DataFrame(tampings)}
    write_tables(tables, folder, study)


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


def _line(text: str, known: "np.ndarray") -> str:
    import numpy as np

    error = _error(known) if len(known) > 1 else None
    mean = with_error(float(known.mean()), error)
    low, middle, high = (shown(float(q), 5) for q in np.quantile(known, LEVELS))
    return f"{text:<34}{mean:>20} {low:>10} {middle:>10} {high:>10}"


def _numbers(values: "np.ndarray") -> dict[str, float | int | None]:
    import numpy as np

    known = values[np.isfinite(values)]
    if not _of_most(known, values):
        return {
            "n": len(known),
            "mean": None,
            "standard_error": None,
            "p5": None,
            "p50": None,
            "p95": None,
        }
    low, middle, high = (float(q) for q in np.quantile(known, LEVELS))
    error = _error(known) if len(known) > 1 else None
    return {
        "n": len(known),
        "mean": float(known.mean()),
        "standard_error": error,
        "p5": low,
        "p50": middle,
        "p95": high,
    }


def _of_most(known: "np.ndarray", values: "np.ndarray") -> bool:
    """Whether ``known`` are most of ``values``: a minority is that of the tracks that wear fastest."""
    return bool(len(known)) and 2 * len(known) >= len(values)


def _error(known: "np.ndarray") -> float:
    return float(known.std(ddof=1)) / math.sqrt(len(known))


def _open(life: "Life") -> str:
    n = int(life.sequence.open.sum())
    return f", {n} of them followed no further (a lower bound)" if n else ""
