"""Names in a study: no two alike, and each that is referred to is there."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from mcsettle.study.checks.parts import Parts
from mcsettle.study.faults import Fault, dotted, shown, suggestion
from mcsettle.study.key_paths import steps_to
from mcsettle.study.schema.published import EFFECT_METRICS, ReferenceTable
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
        yield from _baseline_of_reference(parts, index, row)
    for index, effect in parts.effects.items():
        for key in ("scenario", "baseline"):
            path, name = dotted(("effects", index, key)), getattr(effect, key)
            yield from _unknown(path, "scenario", name, parts.scenario_names)
        if effect.train is not None:
            path = dotted(("effects", index, "train"))
            yield from _unknown(path, "train", effect.train, parts.train_names)
    if parts.economics is not None and parts.economics.baseline is not None:
        name = parts.economics.baseline
        yield from _unknown("economics.baseline", "scenario", name, parts.scenario_names)
    if parts.calibration is not None and not parts.calibration.study:
        name = parts.calibration.scenario
        yield from _unknown("calibration.scenario", "scenario", name, parts.scenario_names)
        if parts.calibration.variant is not None:
            name = parts.calibration.variant
            yield from _unknown("calibration.variant", "variant", name, parts.variant_names)


def _baseline_of_reference(parts: Parts, index: int, row: ReferenceTable) -> Iterator[Fault]:
    """A published effect of a scenario with several baselines says which one it is against."""
    baselines = [e.baseline for e in parts.effects.values() if e.scenario == row.scenario]
    path = dotted(("reference", index, "baseline"))
    if row.baseline is not None and baselines and row.baseline not in baselines:
        yield from _unknown(path, f"baseline of '{row.scenario}'", row.baseline, baselines)
    elif row.baseline is None and len(baselines) > 1 and row.metric in EFFECT_METRICS:
        yield Fault(path, f"is missing: '{row.scenario}' is compared with {', '.join(baselines)}")


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
    counts, first = Counter(entry.name for entry in entries.values()), dict[str, str]()
    for index, entry in entries.items():
        path = dotted((key, index, "name"))
        if counts[entry.name] > 1:
            yield Fault(path, f"received {shown(entry.name)} more than once; names must differ")
        other = first.setdefault(entry.name.casefold(), entry.name)
        if other != entry.name:
            said = (
                f"received {shown(entry.name)}, which differs from {shown(other)} in capitals alone"
            )
            yield Fault(path, f"{said}: their files would be one on some disks; rename one")


def _unknown(
    path: str, kind: str, name: str, known: list[str] | tuple[str, ...]
) -> Iterator[Fault]:
    if known and name not in known:  # a study without any is refused for that
        yield Fault(
            path, f"received {shown(name)}, which is no {kind} here; {suggestion(name, known)}"
        )
