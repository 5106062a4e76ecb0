"""``mcsettle summarise``: the answer on one screen; every number in tables or as JSON."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mcsettle.cli.options import Folder, Force, Json
from mcsettle.cli.spread import print_spread, statistics_data
from mcsettle.cli.tables import add_numbers, console, print_fitted, quantiles, shown, table
from mcsettle.cli.terminal import as_json, checked_file, inform, plainly, say

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
    from mcsettle.storage.marks import refuse_others, write_marked
    from mcsettle.summary.results import read_results

    if picture is not None:
        checked_file(picture, (".png", ".svg", ".pdf"), "--picture")
    one_screen_only = not (every or json_output or picture)
    results = read_results(folder, prices_only=one_screen_only)
    if picture is not None:
        refuse_others([picture], results.study.identity, force)
    if every or json_output:
        from mcsettle.summary.summary import summary_rows

        rows = summary_rows(results)
        if json_output:
            say(as_json(summary_data(results, rows)), True)
        else:
            print_summary(results, rows)
    else:
        from mcsettle.cli.one_screen import one_screen
        from mcsettle.summary.answers import answers

        say("\n".join(one_screen(results, answers(results), str(folder))))
    if picture is not None:
        from mcsettle.report.figures.style import drawn
        from mcsettle.report.notebook import plot

        drawing = drawn(plot(results), picture.suffix.lower().lstrip("."))
        write_marked({picture: drawing}, results.study.identity, force)
        inform(f"Drew {picture}")


def summary_data(results: "Results", rows: list["SummaryRow"]) -> dict[str, Any]:
    """Every number of the summary as JSON has it, standard errors and intervals included."""
    from mcsettle.summary.sign_split import sign_rows

    study = results.study
    counts = results.realisations.groupby(["variant", "scenario", "status"]).size()
    return {
        "title": study.title,
        "study_digest": study.digest,
        "seed": study.seed,
        "counts": counts.reset_index(name="n").to_dict("records"),
        "conditioning": list(weights_data(results)),
        "rows": [_json_row(row) for row in rows],
        "sign_split": [
            _keys(row) | {"statistics": statistics_data(row.statistics)}
            for row in sign_rows(results)
        ],
    }


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


def _keys(row: "SummaryRow") -> dict[str, Any]:
    """What a row is of."""
    return {k: getattr(row, k) for k in ("variant", "scenario", "baseline", "metric", "unit")}


def _json_row(row: "SummaryRow") -> dict[str, Any]:
    return _keys(row) | {
        "statistics": [
            {"statistic": s.statistic, "level": s.level, **dataclasses.asdict(s.estimate)}
            for s in row.statistics
        ],
        "spread": statistics_data(row.spread),
        "reference": row.reference.model_dump() if row.reference else None,
        "reference_percent": row.reference_percent,
        "reference_range": row.reference_range,
        "conditioned": statistics_data(row.conditioned),
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


def weights_data(results: "Results") -> Iterator[dict[str, Any]]:
    """Every variant's conditioning as plain data."""
    for variant in results.study.variant_names:
        conditioning = results.conditioning(variant)
        if conditioning is not None:
            yield {
                "variant": variant,
                "parameter_sets": len(conditioning.weights),
                "effective": conditioning.effective,
                "usable": conditioning.usable,
                "remark": conditioning.remark,
                "inputs": [dataclasses.asdict(b) for b in results.input_bands(variant)],
            }
