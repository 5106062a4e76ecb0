"""Names in a study: no two alike, and each that is referred to is there."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from mcsettle.study.checks.parts import Parts
from mcsettle.study.faults import Fault, dotted, shown, suggestion
from mcsettle.study.key_paths import steps_to
from mcsettle.study.schema.traffic import ScenarioTable
from mcsettle.study.schema.variants import VariantTable


def name_faults(parts: Parts) -> Iterator[Fault]:
    """Names that stand twice, or that refer to nothing."""
    yield from _duplicates("scenarios", parts.scenarios)
    yield from _duplicates("variants", parts.variants)
    for index, scenario in parts.scenarios.items():
        for entry, service in enumerate(scenario.timetable):
            path = dotted(("scenarios", index, "timetable", entry, "train"))
            yield from _unknown(path, "train", service.train, parts.train_names)
    for index, row in parts.reference.items():
        path = dotted(("reference", index, "scenario"))
        yield from _unknown(path, "scenario", row.scenario, parts.scenario_names)
    if parts.economics is not None:
        name = parts.economics.baseline
        yield from _unknown("economics.baseline", "scenario", name, parts.scenario_names)
    if parts.calibration is not None and not parts.calibration.study:
        name = parts.calibration.scenario
        yield from _unknown("calibration.scenario", "scenario", name, parts.scenario_names)
        if parts.calibration.variant is not None:
            name = parts.calibration.variant
            yield from _unknown("calibration.variant", "variant", name, parts.variant_names)


def source_faults(data: Mapping[str, Any], paths: Iterable[str]) -> Iterator[Fault]:
    """Key ``paths`` of ``[sources]`` that lead nowhere in the study ``data``."""
    inputs = {key: value for key, value in data.items() if key != "sources"}
    for path in paths:
        if steps_to(inputs, path) is None:
            said = "names no input of this study; give the path of a key or table"
            yield Fault(f"sources.{path}", said)


def _duplicates(
    key: str, entries: Mapping[int, ScenarioTable] | Mapping[int, VariantTable]
) -> Iterator[Fault]:
    counts = Counter(entry.name for entry in entries.values())
    for index, entry in entries.items():
        if counts[entry.name] > 1:
            path = dotted((key, index, "name"))
            yield Fault(path, f"received {shown(entry.name)} more than once; names must differ")


def _unknown(
    path: str, kind: str, name: str, known: list[str] | tuple[str, ...]
) -> Iterator[Fault]:
    if known and name not in known:  # a study without any is refused for that
        yield Fault(
            path, f"received {shown(name)}, which is no {kind} here; {suggestion(name, known)}"
        )
