"""``mcsettle doctor``: what ``installation`` finds, in words or as JSON."""

import dataclasses
import textwrap
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import typer

from mcsettle.cli.options import Json
from mcsettle.cli.terminal import FAILED, plainly, say_result

if TYPE_CHECKING:
    from mcsettle.cli.installation import Check


@plainly
def doctor(json_output: Json = False) -> None:
    """Check Python, libraries, Taichi, cores, cache and disk; say what to do; exit code 1 if ill."""
    from mcsettle.cli.installation import examine

    checks = examine()
    say_result(checks, json_output, doctor_data, doctor_lines)
    if any(check.state == "failed" for check in checks):
        raise typer.Exit(FAILED)


def doctor_lines(checks: list["Check"]) -> Iterator[str]:
    """One paragraph a check, what to do below it."""
    width = max(len(check.name) for check in checks)
    for check in checks:
        head = f"{check.state:<6}  {check.name:<{width}}  "
        yield textwrap.fill(
            check.found,
            width=110,
            initial_indent=head,
            subsequent_indent=" " * len(head),
            break_long_words=False,
        )
        if check.advice:
            yield f"{' ' * len(head)}→ {check.advice}"
    failed = sum(check.state == "failed" for check in checks)
    yield f"{failed} of {len(checks)} checks failed" if failed else "all is well"


def doctor_data(checks: list["Check"]) -> dict[str, Any]:
    """The checks as JSON has them."""
    passed = all(check.state != "failed" for check in checks)
    return {"checks": [dataclasses.asdict(check) for check in checks], "passed": passed}
