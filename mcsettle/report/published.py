"""Published values beside ours: one table a source, where each falls, why they differ.

Everything comes from the study's ``[[reference]]`` entries; without any there is no such part.
"""

import re
from collections.abc import Iterator

from mcsettle.analysis.table4 import DEFINITIONS, METRIC_OF
from mcsettle.estimate.rounding import number
from mcsettle.report.material import Material
from mcsettle.report.page import Block, Bullets, Picture, Table, Text
from mcsettle.report.pictures import NOT_DRAWN, PAPER, paper_figure
from mcsettle.report.words import (
    as_given,
    cut,
    level,
    metric_words,
    not_reached,
    percentile,
    unit_words,
    unknown_of,
)
from mcsettle.study.schema.published import EFFECT_METRICS, ReferenceTable

WIDE_BAND = (5.0, 95.0)


def published_blocks(material: Material, pictures: list[Picture]) -> Iterator[Block]:
    """Tables by source, the differences in words, and where each figure is."""
    yield Text(
        "Published single values beside the spread of ours. A published number is one realisation: it is "
        "to be compared with P5 to P95, not with the Monte Carlo error. Falls at: the percentile "
        "of our realisations at which it lies."
    )
    for source in sources(material):
        yield source_table(material, source)
        told = tuple(_differences(material, source))
        if told:
            yield Bullets(told)
    yield _figures(material, pictures)


def sources(material: Material) -> list[str]:
    """Sources of the published values, tables in the order of their numbers."""
    names = dict.fromkeys(row.source for row in material.study.reference)

    def place(name: str) -> tuple[int, float, str]:
        numbered = re.match(r"Table (\d+)", name)
        return (0, float(numbered[1]), name) if numbered else (1, 0.0, name)

    return sorted(names, key=place)


def source_table(material: Material, source: str) -> Table:
    """One source's values beside ours, every variant below one another."""
    rows: list[tuple[str, ...]] = []
    unknown: dict[str, list[str]] = {}  # variants that say nothing, and of what
    for entry in _entries(material, source):
        name = metric_words(entry.metric)
        unit = unit_words(entry.unit)
        title = f"{entry.scenario}, {name}: published {as_given(entry.value)}"
        rows.append((f"{title} {unit}".strip(),))
        for row in _ours(material, entry):
            if set(row[1:4]) == {unknown_of(entry.metric)}:
                unknown.setdefault(f"{entry.scenario}, {name}", []).append(row[0])
            else:
                rows.append(row)
    head = ("ours: variant or definition", "P5", "P50", "P95", "published falls at")
    return Table(cut(source), head, tuple(rows), 1, _unknown(unknown), small=True)


def _unknown(unknown: dict[str, list[str]]) -> str:
    """One sentence on what no quantile is known of, quantities of the same variants together."""
    alike: dict[str, list[str]] = {}
    for name, variants in unknown.items():
        alike.setdefault(", ".join(variants), []).append(name)
    return not_reached(alike, "; ")


def _entries(material: Material, source: str) -> list[ReferenceTable]:
    return [row for row in material.study.reference if row.source == source]


def _name(material: Material, entry: ReferenceTable) -> str:
    """Name of the effect, or of the scenario, that a published value is of."""
    effects = (e for e in material.study.effects.values() if e.scenario == entry.scenario)
    effect = next((e.name for e in effects if entry.baseline in (None, e.baseline)), entry.scenario)
    return effect if entry.metric in EFFECT_METRICS else entry.scenario


def _ours(material: Material, entry: ReferenceTable) -> Iterator[tuple[str, ...]]:
    """Cells of ours: variant, P5, P50, P95, percentile; one row a variant or definition."""
    if entry.metric == "mgt_increase_percent":
        yield from _tonnage(material, entry)
        return
    if entry.metric in METRIC_OF.values():
        yield from _stress(material, entry)
        return
    for variant in material.study.variant_names:
        row = material.row(_name(material, entry), entry.metric, variant)
        if row is None:
            yield (variant, "", "no result", "", "")
            continue
        middle = row.at(0.5).with_error(unknown_of(row.metric))
        yield (variant, level(row, 0.05), middle, level(row, 0.95), percentile(row))


def _tonnage(material: Material, entry: ReferenceTable) -> Iterator[tuple[str, ...]]:
    study, effect = material.study, material.study.effects.get(_name(material, entry))
    if effect is None:
        return
    names = (effect.scenario, effect.baseline)
    stated, base = (study.mgt_per_day(name) for name in names)
    yield ("as stated", "", number(100.0 * (stated / base - 1.0)), "", "")
    summed, base = (study.timetable(name).mass_per_day for name in names)
    yield ("sum of the trains", "", number(100.0 * (summed / base - 1.0)), "", "")


def _stress(material: Material, entry: ReferenceTable) -> Iterator[tuple[str, ...]]:
    if material.step_a is None:
        yield ("", "", "drawn with --track", "", "")
        return
    for name in DEFINITIONS:
        if METRIC_OF[name] != entry.metric:
            continue
        for row in material.step_a.table4:
            if (row.definition, row.scenario) == (name, entry.scenario):
                low = "" if row.low == row.high else number(row.low)
                high = "" if row.low == row.high else number(row.high)
                yield (name.split(", ")[1], low, number(row.percent), high, "")


def _differences(material: Material, source: str) -> Iterator[str]:
    """Where the values fall, counted, and the study's own remarks."""
    entries = _entries(material, source)
    rows = [material.row(_name(material, e), e.metric) for e in entries]
    shares = [r.reference_percent for r in rows if r is not None]
    percentiles = [share for share in shares if share is not None]
    if percentiles:
        inside = sum(WIDE_BAND[0] <= share <= WIDE_BAND[1] for share in percentiles)
        yield (
            f"{inside} of {len(percentiles)} published values lie within P5 to P95 of ours (variant "
            f"{material.variant})."
        )
    yield from (cut(note, 600) for note in dict.fromkeys(e.note for e in entries if e.note))


def _figures(material: Material, pictures: list[Picture]) -> Table:
    """Which picture here stands for which figure of the paper."""
    places = {picture.name: place for place, picture in enumerate(pictures, 1)}
    rows = [
        (f"Fig. {paper_figure(material, name)}", f"picture {places[name]}", why)
        for name, (_, why) in PAPER.items()
        if name in places
    ]
    rows += [(f"Fig. {figure}", "not drawn", why) for figure, why in NOT_DRAWN.items()]
    rows.sort(key=lambda row: int(re.findall(r"\d+", row[0])[0]))
    return Table("Figures of the paper", ("figure", "here", "how ours differs"), tuple(rows), 3)
