"""``mcsettle summarise``: the answer on one screen; every number in tables or as JSON."""

import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mcsettle.cli.options import Folder, Force, Json
from mcsettle.cli.picture import checked_picture, draw
from mcsettle.cli.spread import print_spread, statistics_json
from mcsettle.cli.tables import add_numbers, console, print_fitted, quantiles, shown, table
from mcsettle.cli.terminal import inform, plainly, say

if TYPE_CHECKING:
    from mcsettle.summary.results import Results
    from mcsettle.summary.summary import SummaryRow


@plainly
def summarise(
    folder: Folder,
    every: Annotated[bool, typer.Option("--all", help="Every number, in tables.")] = False,
    json_output: Json = False,
    picture: Annotated[
        Path | None, typer.Option(help="Also draw the results into this file (PNG, SVG).")
    ] = None,
    force: Force = False,
) -> None:
    """Print the answer of a run on one screen: prices, what they are worth, when the line is tamped."""
    from mcsettle.storage.marks import refuse_others
    from mcsettle.summary.results import read_results

    if picture is not None:
        checked_picture(picture)
    one_screen_only = not (every or json_output or picture)
    results = read_results(folder, prices_only=one_screen_only)
    if picture is not None:
        refuse_others([picture], results.study.identity, force)
    if every or json_output:
        from mcsettle.summary.summary import summary_rows

        rows = summary_rows(results)
        if json_output:
            say(summary_json(results, rows), True)
        else:
            print_summary(results, rows)
    else:
        from mcsettle.cli.one_screen import one_screen
        from mcsettle.summary.answers import answers

        say("\n".join(one_screen(results, answers(results), str(folder))))
    if picture is not None:
        draw(results, picture, force)
        inform(f"Drew {picture}")


def summary_json(results: "Results", rows: list["SummaryRow"]) -> str:
    """Every number of the summary as JSON, standard errors and intervals included."""
    from mcsettle.summary.sign_split import sign_rows

    study = results.study
    keys = ["variant", "scenario", "status"]
    counts = results.realisations.groupby(keys).size().reset_index(name="n")
    data = {
        "title": study.title,
        "study_digest": study.digest,
        "seed": study.seed,
        "counts": [
            {key: row[key] for key in keys} | {"n": int(row["n"])} for _, row in counts.iterrows()
        ],
        "conditioning": list(weights_json(results)),
        "rows": [_json_row(row) for row in rows],
        "sign_split": list(signs_json(sign_rows(results))),
    }
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False)


def print_summary(results: "Results", rows: list["SummaryRow"]) -> None:
    """Print one table a variant on stdout."""
    from mcsettle.cli.signs import print_signs
    from mcsettle.summary.sign_split import sign_rows

    out, signs = console(), sign_rows(results)
    out.print(results.study.title or "untitled", style="bold")
    for variant in results.study.variants:
        of_variant = [row for row in rows if row.variant == variant.name]
        title = f"{variant.name}: {variant.title}" if variant.title else variant.name
        bands = table(title, "scenario", "metric", "unit")
        add_numbers(bands, "P5", "P50 ± s.e.", "P95", "n", "cens.", "published", "at")
        previous = ""
        for row in of_variant:
            bands.add_row(*_cells(row, row.name != previous))
            given = conditioned_cells(row)
            if given is not None:
                bands.add_row(*given)
            previous = row.name
        if of_variant:
            print_fitted(out, bands, ("at", "published", "cens.", "n", "unit"))
        else:
            out.print(f"{title}: no realisation has a result")
        print_spread(of_variant)
        print_signs([row for row in signs if row.variant == variant.name])
        print_inputs(results, variant.name)
    for line in _remarks(results):
        out.print(line)


def _cells(row: "SummaryRow", first: bool) -> list[str]:
    middle = row.at(0.5)
    name = row.name if first else ""
    band = quantiles(row.at(0.05), middle, row.at(0.95))
    counts = [str(middle.n), str(middle.n_censored)]
    published = f"{row.reference.value:g}" if row.reference else ""
    return [name, row.metric, row.unit, *band, *counts, published, _percentile(row)]


def _percentile(row: "SummaryRow") -> str:
    """Where the published value falls, and in brackets where it might with what is not known."""
    if row.reference_percent is None or row.reference_range is None:
        return ""
    low, high = (round(end) for end in row.reference_range)
    return f"P{row.reference_percent:.0f}" + (f" ({low}–{high})" if low != high else "")


def _remarks(results: "Results") -> Iterator[str]:
    from mcsettle.report.assumptions import stress_remarks

    yield (
        f"P5, P50, P95: spread between {_what_varies(results)}. ± s.e.: Monte Carlo error of "
        "the median. –: not reached, or not known for too many censored realisations."
    )
    yield (
        "at: percentile of our realisations at which the published value falls; in brackets what it may "
        "be, censored pairs being unknown."
    )
    yield from stress_remarks(results.study)
    sources = sorted({row.source for row in results.study.reference})
    if sources:
        yield f"published: {'; '.join(sources)}"
    note = results.study.calibration
    if note is not None:
        target = f"{note.scenario} at {note.target_days:g} days"
        yield f"calibration: factor {note.factor:g}, {target}. {note.note}"
    failed = int((results.realisations["status"] == "failed").sum())
    if failed:
        yield f"{failed} realisations failed; the column 'failure' says why."


def _what_varies(results: "Results") -> str:
    sets = results.realisations["parameter_set"].nunique()
    tracks = "realisations (track sections)"
    return tracks if sets == 1 else f"{tracks} and {sets} parameter sets (draws of the inputs)"


def _json_row(row: "SummaryRow") -> dict[str, Any]:
    reference = row.reference.model_dump() if row.reference else None
    return {
        "variant": row.variant,
        "scenario": row.scenario,
        "baseline": row.baseline,
        "metric": row.metric,
        "unit": row.unit,
        "statistics": [
            {"statistic": s.statistic, "level": s.level, **dataclasses.asdict(s.estimate)}
            for s in row.statistics
        ],
        "spread": statistics_json(row.spread),
        "reference": reference,
        "reference_percent": row.reference_percent,
        "reference_range": row.reference_range,
        "conditioned": statistics_json(row.conditioned),
        "conditioned_percent": row.conditioned_percent,
    }


def conditioned_cells(row: "SummaryRow") -> list[str] | None:
    """Cells of the second line of a row: the same numbers given the observations; None without."""
    low, middle, high = (row.conditioned_at(level) for level in (0.05, 0.5, 0.95))
    if low is None or middle is None or high is None:
        return None
    share = row.conditioned_percent
    at = "" if share is None else f"P{share:.0f}"
    return ["", "  given observed", "", *quantiles(low, middle, high), "", "", "", at]


def print_inputs(results: "Results", variant: str) -> None:
    """What the observations leave of the inputs, and how many parameter sets carry the weight."""
    conditioning = results.conditioning(variant)
    if conditioning is None:
        return
    out, n = console(), len(results.study.observed)
    out.print(
        f"given observed: {n} observation{'s' if n > 1 else ''}; {conditioning.effective:.1f} of "
        f"{len(conditioning.weights)} parameter sets carry the weight.",
    )
    if conditioning.remark:
        out.print(f"warning: {conditioning.remark}")
    bands = results.input_bands(variant)
    if not bands:
        return
    inputs = table("Inputs: P5 / P50 / P95", "input")
    add_numbers(inputs, "as drawn", "given observed")
    for band in bands:
        inputs.add_row(
            band.input, *(" / ".join(map(shown, part)) for part in (band.drawn, band.conditioned))
        )
    out.print(inputs)


def weights_json(results: "Results") -> Iterator[dict[str, Any]]:
    """Every variant's conditioning as plain data."""
    for variant in results.study.variant_names:
        found = results.conditioning(variant)
        if found is not None:
            yield {
                "variant": variant,
                "parameter_sets": len(found.weights),
                "effective": found.effective,
                "usable": found.usable,
                "remark": found.remark,
                "inputs": [dataclasses.asdict(b) for b in results.input_bands(variant)],
            }


def signs_json(rows: "list[SummaryRow]") -> Iterator[dict[str, Any]]:
    """What added services roughen and harden as plain data."""
    for row in rows:
        keys = {
            key: getattr(row, key) for key in ("variant", "scenario", "baseline", "metric", "unit")
        }
        yield keys | {"statistics": statistics_json(row.statistics)}
