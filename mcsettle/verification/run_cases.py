"""Verification cases by name: the models beside closed forms and exact solutions.

``run_cases()`` computes them, ``table`` prints them. A case compares one number: where a whole
curve is checked, the number at its worst point. The cases are in ``closed_form_cases``
(closed forms and layered ground) and ``section_cases`` (the 2.5D section against layered ground).
"""

from collections.abc import Callable, Iterable

from mcsettle.verification.case import Case
from mcsettle.verification.closed_form_cases import CLOSED_CASES
from mcsettle.verification.section_cases import SECTION_CASES

__all__ = ["CASES", "Case", "run_cases", "table"]

CASES: dict[str, Callable[[str], Case]] = {**CLOSED_CASES, **SECTION_CASES}


def run_cases(names: Iterable[str] | None = None) -> list[Case]:
    """Compute verification cases, all of them or those named, in the order of ``CASES``.

    Raises
    ------
    ValueError
        If a name is unknown.
    """
    wanted = set(CASES) if names is None else set(names)
    unknown = sorted(wanted - set(CASES))
    if unknown:
        raise ValueError(f"unknown case {', '.join(unknown)}; choose from {', '.join(CASES)}")
    return [build(name) for name, build in CASES.items() if name in wanted]


def table(cases: list[Case]) -> str:
    """Plain text table: one line per case, then how many passed."""
    head = ("case", "expected", "obtained", "unit", "error", "tolerance", "", "source")
    rows = [head] + [
        (
            case.name,
            _number(case.expected),
            _number(case.obtained),
            case.unit,
            f"{case.error:.1e}",
            f"{case.tolerance:.0e}",
            "ok" if case.passed else "FAILED",
            case.source,
        )
        for case in cases
    ]
    widths = [max(len(row[i]) for row in rows) for i in range(len(head) - 1)]
    lines = [
        "  ".join([*(cell.ljust(w) for cell, w in zip(row, widths, strict=False)), row[-1]])
        for row in rows
    ]
    passed = sum(case.passed for case in cases)
    return "\n".join([*lines, f"{passed} of {len(cases)} cases within tolerance"])


def _number(value: complex) -> str:
    """Six digits; real part alone where the imaginary one is zero."""
    if value.imag == 0.0:
        return f"{value.real:.6g}"
    return f"{value.real:.5g}{value.imag:+.5g}i"
