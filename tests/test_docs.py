"""The documents against the code: links, study keys with their limits, columns, commands, words."""

import re
from pathlib import Path
from typing import Any, get_args

import pytest
import typer

from mcsettle.cli.app import app
from mcsettle.cli.terminal import EXIT_CODES
from mcsettle.storage.tables import TABLES
from mcsettle.study.schema.base import Table
from mcsettle.study.schema.economics import EconomicsTable, EffectTable, MaintenanceTable
from mcsettle.study.schema.grounds import GroundsTable, SoilTable
from mcsettle.study.schema.profile import ProfileTable, RecordTable
from mcsettle.study.schema.published import METRICS, CalibrationTable, ReferenceTable
from mcsettle.study.schema.run import LimitTable, RunTable, SettlementTable
from mcsettle.study.schema.spatial_variability import SpatialVariabilityTable
from mcsettle.study.schema.step_a import StepATable
from mcsettle.study.schema.study import json_schema
from mcsettle.study.schema.track import (
    GroundTable,
    LayerTable,
    PadTable,
    RailTable,
    SleeperTable,
    SofteningTable,
    SupportTable,
    TrackTable,
    UnderSleeperPadTable,
)
from mcsettle.study.schema.traffic import (
    ConsistTable,
    ScenarioTable,
    ServiceTable,
    TrainTable,
    VehicleTable,
)
from mcsettle.study.schema.uncertain import CorrelationTable, UncertainTable
from mcsettle.study.schema.variants import VariantTable
from mcsettle.study.study import Study

ROOT = Path(__file__).resolve().parents[1]
GUIDE = "\n".join(
    path.read_text(encoding="utf-8") for path in sorted((ROOT / "docs" / "guide").glob("*.md"))
)
PAGES = sorted(
    [*ROOT.glob("*.md"), *(ROOT / "studies").glob("*.md"), *(ROOT / "docs").rglob("*.md")]
)
HEADINGS: dict[str, type[Table]] = {
    "Top level": Study,
    "`[track]`": TrackTable,
    "`[track.rail]`": RailTable,
    "`[track.pad]`": PadTable,
    "`[track.sleeper]`": SleeperTable,
    "`[track.support]`": SupportTable,
    "`[track.layers.NAME]`": LayerTable,
    "`[track.softening]`": SofteningTable,
    "`[profile]`": ProfileTable,
    "`[profile.record]`": RecordTable,
    "`[settlement]`": SettlementTable,
    "`[grounds]`": GroundsTable,
    "`[grounds.materials.CODE]`": SoilTable,
    "`[spatial_variability]`": SpatialVariabilityTable,
    "`[limit]`": LimitTable,
    "`[run]`": RunTable,
    "`[step_a]`": StepATable,
    "`[economics]`": EconomicsTable,
    "`[[effects]]`": EffectTable,
    "`[maintenance]`": MaintenanceTable,
    "`[trains.NAME]`": TrainTable,
    "Entries of a consist": ConsistTable,
    "`[vehicles.NAME]`": VehicleTable,
    "`[[track.ground]]`": GroundTable,
    "`[track.under_sleeper_pad]`": UnderSleeperPadTable,
    "`[[scenarios]]`": ScenarioTable,
    "Services of a timetable": ServiceTable,
    "`[[variants]]`": VariantTable,
    "`[[reference]]`": ReferenceTable,
    "`[[uncertain]]`": UncertainTable,
    "`[[correlations]]`": CorrelationTable,
    "`[calibration]`": CalibrationTable,
}
COLUMNS = 5  # of a table of keys
NUMBER = re.compile(r"(?<![\w.^])-?\d+(?:\.\d+)?(?:e\d+)?")
LIMITS = {"minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum", "ge", "gt", "le", "lt"}
COUNTS = {"minItems", "maxItems", "minProperties", "maxProperties"}
# Words of a workshop, American spellings, and paths of somebody's machine.
FORBIDDEN = re.compile(
    r"\b(?:assistant|chatbot|prompt(?:ed|s)?|language model|issue tracker|issue #?\d+)\b"
    r"|\b(?:behavior|center(?:line)?|color|modeling|modeled|normalize|summarize|gray)\b"
    r"|(?<![\w.])/(?:home|root|tmp|work|mnt|Users)/",
    re.IGNORECASE,
)


def part(heading: str) -> str:
    """Text of the guide below a heading of the third level, up to the next heading."""
    match = re.search(rf"^### {re.escape(heading)}$(.*?)(?=^#)", GUIDE, re.MULTILINE | re.DOTALL)
    assert match, f"the guide has no heading '{heading}'"
    return match[1]


def rows(heading: str) -> dict[str, str]:
    """Lines of the table below a heading by the key in their first cell."""
    lines = [line for line in part(heading).splitlines() if line.startswith("| `")]
    return {line.split("`")[1]: line for line in lines if line.count("|") == COLUMNS + 1}


def alias(name: str, table: type[Table]) -> str:
    return table.model_fields[name].alias or name


def numbers(row: str) -> set[float]:
    return {float(found) for found in NUMBER.findall(row.replace("2^63", str(2**63)))}


def limits(entry: Any) -> set[float]:
    """Every bound of a key's schema, single values only: not those of its entries."""
    if isinstance(entry, list):
        return set().union(*(limits(part) for part in entry))
    if not isinstance(entry, dict):
        return set()
    own = {float(value) for key, value in entry.items() if key in LIMITS | COUNTS}
    return own | limits(entry.get("anyOf", []))


def leaves(entry: dict[str, Any]) -> list[dict[str, Any]]:
    """The alternatives of a key's schema, its entries' in a list."""
    below = [*entry.get("anyOf", []), *([entry["items"]] if "items" in entry else [])]
    return [entry, *(leaf for part in below for leaf in leaves(part))]


@pytest.mark.parametrize("heading", HEADINGS)
def test_every_key_has_its_row_and_no_row_is_stale(heading: str) -> None:
    table = HEADINGS[heading]
    assert set(rows(heading)) == {alias(name, table) for name in table.model_fields}


@pytest.mark.parametrize("heading", HEADINGS)
def test_defaults_and_required_keys_are_stated(heading: str) -> None:
    table, found = HEADINGS[heading], rows(heading)
    for name, field in table.model_fields.items():
        cell = found[alias(name, table)].split("|")[3]
        default = field.default
        assert ("required" in cell) == field.is_required(), f"{heading} {name}: {cell}"
        if isinstance(default, bool):
            assert str(default).lower() in cell, f"{heading} {name}: {cell}"
        elif isinstance(default, str):
            assert (f'"{default}"' if default else "empty") in cell, f"{heading} {name}: {cell}"
        elif isinstance(default, int | float):
            assert float(default) in numbers(cell), f"{heading} {name}: {cell}"
        elif isinstance(default, tuple) and name == "history_days":
            assert numbers(cell) == set(default)


@pytest.mark.parametrize("heading", HEADINGS)
def test_limits_and_choices_are_stated(heading: str) -> None:
    table, found, whole = HEADINGS[heading], rows(heading), json_schema()
    definition = whole if table is Study else whole["$defs"][table.__name__]
    for name, entry in definition["properties"].items():
        row = found[name]
        missing = limits(entry) - numbers(row) - ({0.0} if "0 or more" in row else set())
        assert not missing, f"{heading} {name}: {missing} missing in {row}"
        for option in [*entry.get("anyOf", []), entry]:
            for choice in option.get("enum", []):
                assert f'"{choice}"' in row, f"{heading} {name}: {choice} missing"
        kinds = {option.get("type") for option in leaves(entry)}
        takes_text = {"string", "number"} <= kinds
        assert takes_text == ("or text" in row), f"{heading} {name}: {row}"


def test_every_metric_is_named() -> None:
    for metric in get_args(METRICS):
        assert f"`{metric}`" in GUIDE or f'`"{metric}"`' in GUIDE, metric


@pytest.mark.parametrize("name", TABLES)
def test_every_column_is_named_with_its_unit(name: str) -> None:
    text = GUIDE.split(f"**`{name}`**")[1].split("\n**`")[0].split("\nEach folder")[0]
    for column in TABLES[name].columns:
        line = next((x for x in text.splitlines() if f"`{column.name}`" in x), None)
        assert line is not None, f"{name}.{column.name}"
        unit = column.unit.split(" (")[0]
        assert unit in line.split("|")[2], f"{name}.{column.name}: {unit} missing in {line}"


EVERYWHERE = {"--help", "--quiet"}


def test_every_command_and_option_is_named() -> None:
    for option in EVERYWHERE:
        assert f"`{option}`" in GUIDE
    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    for name, command in commands.items():
        row = next((x for x in GUIDE.splitlines() if x.startswith(f"| `mcsettle {name}")), None)
        assert row is not None, name
        options = {o for p in command.params for o in p.opts if o.startswith("--")} - EVERYWHERE
        for option in options:
            assert f"`{option}`" in row, f"{name} {option}"
        assert options == set(re.findall(r"`(--[a-z-]+)`", row)), f"{name}: stale option in {row}"


def test_every_exit_code_is_named() -> None:
    text = GUIDE.split("## Exit codes")[1].split("\n## ")[0]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    in_readme = readme.partition("Exit codes: ")[2].partition("\n\n")[0]
    assert [int(code) for code in re.findall(r"^\| (\d+) \|", text, re.MULTILINE)] == [*EXIT_CODES]
    for code in EXIT_CODES:
        assert re.search(rf"\b{code}\b", in_readme), f"README does not name the exit code {code}"


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings as code hosts make them."""
    found, text = set(), re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for title in re.findall(r"^#{1,6} +(.*)$", text, re.MULTILINE):
        plain = re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
        found.add(plain)
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_links_resolve(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    text = re.sub(r"`[^`\n]*`", "", text)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if "://" in target:
            continue
        name, _, anchor = target.partition("#")
        to = (page.parent / name).resolve() if name else page
        assert to.exists(), f"{page.name}: {target}"
        assert to.is_relative_to(ROOT), f"{page.name}: {target} leaves the repository"
        if anchor:
            assert anchor in anchors(to), f"{page.name}: {target}"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_words(page: Path) -> None:
    found = FORBIDDEN.search(page.read_text(encoding="utf-8"))
    assert found is None, f"{page.name}: '{found[0]}'"


FOLDERS = ("mcsettle", "kernels", "cli", "tests", "studies")
FILES = [
    path.relative_to(ROOT).as_posix() for folder in FOLDERS for path in (ROOT / folder).rglob("*.*")
]


def test_modules_and_tests_that_pages_name_exist() -> None:
    for page in PAGES:
        for name in re.findall(r"`((?:\w+/)*\w+\.(?:py|toml))`", page.read_text(encoding="utf-8")):
            ours = any(f"/{path}".endswith(f"/{name}") for path in FILES)
            assert ours or name.endswith("study.toml"), f"{page.name} names {name}"


def test_every_verification_case_and_file_is_listed() -> None:
    from mcsettle.verification.run_cases import CASES

    text = (ROOT / "docs" / "verification.md").read_text(encoding="utf-8")
    files = [path.name for path in (ROOT / "tests" / "verification").glob("test_*.py")]
    assert [
        name for name in [*CASES, *files] if not re.search(rf"[`/]{re.escape(name)}`", text)
    ] == []


def test_every_public_name_is_in_the_python_reference() -> None:
    import mcsettle

    text = (ROOT / "docs" / "reference.md").read_text(encoding="utf-8")
    names = re.findall(r"^::: mcsettle\.(\w+)$", text, re.MULTILINE)
    assert sorted(names) == sorted(mcsettle.__all__)


def test_every_page_is_in_the_contents_of_the_site() -> None:
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").split("\nnav:\n")[1]
    pages = {path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")}
    outside = {"index.md", "studies.md", "contributing.md", "changelog.md"}
    notebooks = {f"tutorials/{path.stem}.md" for path in (ROOT / "docs").rglob("*.ipynb")}
    assert set(re.findall(r"[\w/-]+\.md", text)) == pages | outside | notebooks


def test_the_gallery_shows_every_picture_that_it_keeps_and_keeps_them_small() -> None:
    shown = re.findall(
        r"\]\(gallery/([\w-]+\.png)\)",
        (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8"),
    )
    kept = {path.name: path.stat().st_size for path in (ROOT / "docs" / "gallery").iterdir()}
    assert sorted(shown) == sorted(kept)
    assert max(kept.values()) < 100_000
