"""A reader's test: what the first screen of every study with prices says, at eight tracks."""

import functools
import re
import tomllib
from pathlib import Path

import made_run
import numpy as np
import pytest

from mcsettle.report.first_page import first_page
from mcsettle.report.material import Material
from mcsettle.report.page import Page
from mcsettle.report.price_words import question, scope
from mcsettle.report.render import html
from mcsettle.storage.provenance import read_provenance
from mcsettle.study.study import Study, load_study
from mcsettle.summary.answers import answers
from mcsettle.summary.results import read_results

STUDIES = Path(__file__).resolve().parents[2] / "studies"


def has_effects(path: Path) -> bool:
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    return "effects" in tables or "effect" in tables.get("economics", {})


PRICED = [path for path in sorted(STUDIES.glob("*.toml")) if has_effects(path)]
TRACKS, SETS = 8, 2


def first_screen(folder: Path) -> str:
    """The first page as text, without computing what is folded behind it."""
    results = read_results(folder)
    material = Material(results, (), answers(results), read_provenance(folder))
    asked = question(material.answers)
    size = scope(results, material.answers)
    text = html(Page(results.study.title, asked, size, first_page(material), ()))
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", text.split("<nav")[0].split("<main")[1]))


@functools.cache
def small(path: Path) -> Study:
    """The study at eight tracks, and of a nested one at two parameter sets."""
    study = load_study(path)
    return study.with_run(realisations=TRACKS, parameter_sets=SETS if study.nested else None)


def made(folder: Path, study: Study, censored: bool = False) -> Path:
    """Eight tracks of ``study``: every scenario a few per cent shorter than the one before."""
    base = np.linspace(500.0, 900.0, TRACKS)
    days = {name: base * 0.97**i for i, name in enumerate(study.scenario_names)}
    if censored:
        days = {name: np.where(np.arange(TRACKS) < 3, d, np.nan) for name, d in days.items()}
    return made_run.write(folder, study, days)


@pytest.mark.parametrize("path", PRICED, ids=[path.stem for path in PRICED])
def test_first_screen_names_what_a_price_needs(path: Path, tmp_path: Path) -> None:
    study = small(path)
    text = first_screen(made(tmp_path / "run", study))
    assert study.currency in text
    assert re.search(r"(pence|cents|[£€][\d.]+) per (1000 gross tonne|train)-km", text)
    # A price with its 95 % interval, the range over the forms or that there is one, and its worth.
    assert "line mean (95 %)" in text
    assert re.search(r"−?[\d.]+ \(−?[\d.]+ to −?[\d.]+\)", text)
    assert re.search(r"over \d+ model forms|in all \d+ model forms|in one model form", text)
    assert re.search(r"Supported: (yes|only as a range|no)", text)
    assert "When is the line tamped?" in text
    assert "What would narrow it" in text


@pytest.mark.parametrize("path", PRICED, ids=[path.stem for path in PRICED])
def test_nothing_censored_is_stated_as_a_mean(path: Path, tmp_path: Path) -> None:
    study = small(path)
    text = first_screen(made(tmp_path / "run", study, censored=True))
    n = SETS if study.nested else 1
    assert f"no price. Only {3 * n} of {TRACKS * n} pairs of sections reach the limit" in text
    assert not re.search(r"(costs?|saves?) about", text)
    assert not re.search(r"\d \(−?[\d.]+ to −?[\d.]+\)", text)  # no price with an interval
    assert "Supported: no" in text


def test_date_of_tamping(tmp_path: Path) -> None:
    study = made_run.study(start_date="2026-03-01")
    text = first_screen(made(tmp_path / "run", study))
    assert "2028-01" in text  # 700 days on
    assert study.digest == made_run.study().digest
