"""What ``validate`` and ``doctor`` print: lines, and the same as JSON."""

import dataclasses
import json
import textwrap
from collections.abc import Iterator
from typing import TYPE_CHECKING

from mcsettle.cli.terminal import Progress
from mcsettle.errors import InputError

if TYPE_CHECKING:
    from mcsettle.cli.installation import Check
    from mcsettle.verification.run_cases import Case


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
    found = []
    for done, name in enumerate(wanted):
        progress("Verification", done, len(wanted))
        found += run_cases([name])
    progress("Verification", len(wanted), len(wanted))
    return found


def cases_json(cases: list["Case"]) -> str:
    """Verification cases as JSON; a complex number is its real and imaginary part."""
    rows = [
        {
            "name": case.name,
            "source": case.source,
            "expected": _parts(case.expected),
            "obtained": _parts(case.obtained),
            "unit": case.unit,
            "error": _finite(case.error),
            "tolerance": case.tolerance,
            "passed": bool(case.passed),
        }
        for case in cases
    ]
    data = {"cases": rows, "passed": all(case.passed for case in cases)}
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False)


def convergence_text(names: list[str], as_json: bool, progress: Progress) -> str:
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
    if as_json:
        return json.dumps([dataclasses.asdict(level) for level in levels], indent=1)
    return convergence_table(levels)


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


def doctor_json(checks: list["Check"]) -> str:
    """The checks as JSON."""
    data = {
        "checks": [dataclasses.asdict(check) for check in checks],
        "passed": all(check.state != "failed" for check in checks),
    }
    return json.dumps(data, indent=1, ensure_ascii=False)


def _parts(value: complex) -> float | list[float | None] | None:
    """A number for JSON: real, or [real, imaginary]; null where it is not finite."""
    whole = complex(value)
    return [_finite(whole.real), _finite(whole.imag)] if whole.imag else _finite(whole.real)


def _finite(value: float) -> float | None:
    number = float(value)
    return number if number - number == 0.0 else None
