"""``mcsettle tornado``: which uncertain input moves the answer."""

import dataclasses
from typing import TYPE_CHECKING, Annotated

import typer

from mcsettle.cli.options import Json, StudyFile, Variant, as_allowed
from mcsettle.cli.study_file import study_in
from mcsettle.cli.tables import add_numbers, console, shown, table
from mcsettle.cli.terminal import Progress, as_json, cores, plainly, say
from mcsettle.errors import InputError

if TYPE_CHECKING:
    from mcsettle.analysis.tornado import Bar


@plainly
def tornado(
    study: StudyFile,
    variant: Variant = None,
    realisations: Annotated[
        int, typer.Option(min=1, callback=as_allowed, help="Tracks of each run.")
    ] = 32,
    json_output: Json = False,
) -> None:
    """Move each uncertain input to its P10 and P90, the others central, on the same tracks."""
    loaded = study_in(study)
    if variant is not None:
        loaded.variant(variant)
    if not loaded.uncertain:
        raise InputError(f"{study} has no [[uncertain]] inputs; add some to see what they do")
    from mcsettle.analysis.tornado import tornado as bars_of

    bars = bars_of(loaded, variant, realisations, Progress(), cores())
    if json_output:
        say(as_json([dataclasses.asdict(bar) for bar in bars]), True)
    else:
        print_tornado(bars)


def print_tornado(bars: "list[Bar]") -> None:
    """One table on stdout: medians at P10 and P90 of each input, the others central."""
    title = "Medians with one input at its P10 and its P90, the others central"
    medians = table(title, "scenario", "metric", "input", "P10", "P90")
    add_numbers(medians, "at P10", "central", "at P90")
    previous: tuple[str, str] = ("", "")
    for bar in bars:
        head = (bar.scenario, bar.metric)
        cells = [shown(v) for v in (bar.low, bar.high, bar.at_low, bar.central, bar.at_high)]
        medians.add_row(*(head if head != previous else ("", "")), bar.input, *cells)
        previous = head
    console().print(medians)
