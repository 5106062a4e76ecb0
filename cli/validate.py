"""``mcsettle validate``: closed forms, exact solutions and convergence against the code."""

import dataclasses
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mcsettle.cli.options import Json
from mcsettle.cli.terminal import FAILED, Progress, as_json, plainly, say
from mcsettle.errors import InputError
from mcsettle.estimate.estimate import finite

if TYPE_CHECKING:
    from mcsettle.verification.run_cases import Case


@plainly
def validate(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAMES]...", help="Cases or choices (default: all)."),
    ] = None,
    json_output: Json = False,
    convergence: Annotated[
        bool, typer.Option("--convergence", help="Refine Step A's numerical choices instead.")
    ] = False,
) -> None:
    """Compare the models with closed forms and exact solutions; exit code 1 if one is missed."""
    if convergence:
        say(convergence_text(names or [], json_output, Progress()), json_output)
        return
    cases = run_named_cases(names or [], Progress())
    from mcsettle.verification.run_cases import table

    say(as_json(cases_data(cases)) if json_output else table(cases), json_output)
    if not all(case.passed for case in cases):
        raise typer.Exit(FAILED)


def run_named_cases(names: list[str], progress: Progress) -> list["Case"]:
    """Verification cases of these names (none: all), in their own order, reporting each.

    Raises
    ------
    InputError
        A name is unknown.
    """
    from mcsettle.verification.run_cases import CASES, run_cases

    unknown = sorted(set(names) - set(CASES))
    if unknown:
        raise InputError(
            f"{', '.join(unknown)}: no such verification case; choose from {', '.join(CASES)}"
        )
    wanted = [name for name in CASES if not names or name in names]
    cases = []
    for done, name in enumerate(wanted):
        progress("Verification", done, len(wanted))
        cases += run_cases([name])
    progress("Verification", len(wanted), len(wanted))
    return cases


def cases_data(cases: list["Case"]) -> dict[str, Any]:
    """Verification cases as JSON has them; a complex number is its real and imaginary part."""
    rows = [
        {
            "name": case.name,
            "source": case.source,
            "expected": _parts(case.expected),
            "obtained": _parts(case.obtained),
            "unit": case.unit,
            "error": finite(case.error),
            "tolerance": case.tolerance,
            "passed": bool(case.passed),
        }
        for case in cases
    ]
    return {"cases": rows, "passed": all(case.passed for case in cases)}


def convergence_text(names: list[str], in_json: bool, progress: Progress) -> str:
    """The convergence study of these choices (none: all), as a table or JSON.

    Raises
    ------
    InputError
        A name is unknown.
    """
    from mcsettle.verification.convergence import convergence_table, study_convergence

    try:
        levels = study_convergence(choices=tuple(names) or None, progress=progress)
    except ValueError as error:
        raise InputError(str(error)) from None
    if in_json:
        return as_json([dataclasses.asdict(level) for level in levels])
    return convergence_table(levels)


def _parts(value: complex) -> float | list[float | None] | None:
    """A number for JSON: real, or [real, imaginary]; null where it is not finite."""
    whole = complex(value)
    return [finite(whole.real), finite(whole.imag)] if whole.imag else finite(whole.real)
