"""The assumptions register: every input, its value or distribution, its source, who set it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mcsettle.report.origins import Origins
from mcsettle.report.page import Table
from mcsettle.report.words import cut
from mcsettle.study.key_paths import is_number, leaves
from mcsettle.study.key_units import unit_at
from mcsettle.study.study import Study
from mcsettle.study.written import study_data

OMITTED = {
    "schema_version",
    "title",
    "start_date",
    "reference",
    "calibration",
    "sources",
    "uncertain",
    "correlations",
    "observed",
    "files_outside",
    "stated",
}
SHORT = 3  # list entries shown


@dataclass(frozen=True)
class Entry:
    """One input: ``set_by`` is who set it; ``given`` a number or truth value as such."""

    path: str
    value: str
    unit: str
    distribution: str
    set_by: str
    source: str
    given: float | bool | None = None


def entries(study: Study) -> list[Entry]:
    """Every input of ``study`` in the order of its file."""
    data = study_data(study)
    drawn = {path: table for table in study.uncertain for path in table.paths}
    origins, register = Origins(study), []
    for path, value in leaves({k: v for k, v in data.items() if k not in OMITTED}):
        if value in ("", [], ()):
            continue
        table = drawn.get(path)
        set_by, source = origins.of(path, value)
        words = "" if table is None else _distribution(table.model_dump(exclude_none=True))
        if table is not None:
            set_by = "study"
            source = table.source or source
        unit = unit_at(data, path)
        unit = unit if is_number(value) and unit != "1" else ""
        given = value if isinstance(value, bool | int | float) else None
        register.append(Entry(path, _shown(value), unit, words, set_by, source, given))
    return register


def register_table(study: Study) -> Table:
    """The register as a table."""
    rows = tuple(
        (e.path, e.value, e.unit, cut(e.distribution, 200), e.set_by, cut(e.source, 300))
        for e in entries(study)
    )
    head = ("input", "value", "unit", "distribution", "set by", "source")
    note = (
        "Set by: study, the study file; run, an option of the run; paper, a value of the paper's "
        "tables or text, and library, one of a shipped vehicle or train, that the study did not change; "
        "default, this program's choice where the paper is silent. An input with a distribution has its "
        "central value in the second column."
    )
    return Table("Assumptions register", head, rows, 6, note, small=True)


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}".replace("-", "−")
    if isinstance(value, list | tuple):
        parts = [_shown(v) for v in value]
        more = f", … {parts[-1]} ({len(parts)} values)" if len(parts) > SHORT + 1 else ""
        return ", ".join(parts[: SHORT if more else None]) + more
    return cut(str(value), 80)


def _distribution(table: Mapping[str, Any]) -> str:
    others = {"input", "also", "distribution", "source", "fitted"}
    given = [f"{k.replace('_', ' ')} {_shown(v)}" for k, v in table.items() if k not in others]
    shared = table.get("also", ())
    text = f"{table['distribution'].replace('_', '-')}: {', '.join(given)}"
    return text + (f"; one draw with {', '.join(shared)}" if shared else "")
