"""Numbers of the pages against the small tables that ``make paper`` writes."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SPEC = importlib.util.spec_from_file_location("paper_tables", ROOT / "studies" / "paper_tables.py")
assert SPEC is not None
assert SPEC.loader is not None
paper_tables = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(paper_tables)

QUOTED = sorted({*paper_tables.PAGES, *(quote["page"] for quote in paper_tables.quotes())})


@pytest.mark.parametrize("page", QUOTED)
def test_quoted_numbers_are_those_of_the_tables(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert paper_tables.renewed(page, text) == text


def test_a_number_that_differs_is_found() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    row = next(line for line in text.splitlines() if line.startswith("| 209 |"))
    wrong = text.replace(row, row.replace(row.split("|")[2], f" 1{row.split('|')[2].strip()} "))
    assert wrong != text
    assert paper_tables.renewed("README.md", wrong) == text


def test_a_sentence_that_is_gone_is_found() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    with pytest.raises(ValueError, match="0 places say"):
        paper_tables.renewed("README.md", text.replace("shorten the interval by medians", "do"))


def test_rounding_noise_is_no_error() -> None:
    """The ends of an identity have three digits, not the nineteen of its error."""
    row = paper_tables.read_table("traffic")["calibrated", "B", "elasticity"]
    assert 0.0 < float(row["error"]) < 1e-15
    assert paper_tables._line(row).split(" | ")[2:5] == ["−0.986"] * 3
