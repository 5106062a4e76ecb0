"""A reader's test: what the first screen of every study with prices says, at eight tracks."""

import re
import tomllib
from pathlib import Path

import made_run
import numpy as np
import pytest

from mcsettle.report.build import read_report
from mcsettle.report.render import html
from mcsettle.study.study import Study, load_study

STUDIES = Path(__file__).resolve().parents[2] / "studies"
PRICED = [
    path
    for path in sorted(STUDIES.glob("*.toml"))
    if "economics" in tomllib.loads(path.read_text(encoding="utf-8"))
]
PLAIN = [path for path in PRICED if not load_study(path).nested]
TRACKS = 8


def first_screen(folder: Path) -> str:
    """The first page as text."""
    text = html(read_report(folder))
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", text.split("<nav")[0].split("<main")[1]))


def made(folder: Path, study: Study, censored: bool = False) -> Path:
    """Eight tracks of ``study``: every scenario a few per cent shorter than the one before."""
    base = np.linspace(500.0, 900.0, TRACKS)
    days = {name: base * 0.97**i for i, name in enumerate(study.scenario_names)}
    if censored:
        days = {name: np.where(np.arange(TRACKS) < 3, d, np.nan) for name, d in days.items()}
    return made_run.write(folder, study, days)


@pytest.mark.parametrize("path", PLAIN, ids=[path.stem for path in PLAIN])
def test_first_screen_names_what_a_price_needs(path: Path, tmp_path: Path) -> None:
    study = load_study(path).with_run(realisations=TRACKS)
    text = first_screen(made(tmp_path / "run", study))
    assert study.currency in text
    assert re.search(r"(pence|cents|[£€][\d.]+) per (1000 gross tonne|train)-km", text)
    # A price with its 95 % interval, the range over the forms or that there is one, and its worth.
    assert "line mean (95 %)" in text
    assert re.search(r"−?[\d.]+ \(−?[\d.]+ to −?[\d.]+\)", text)
    assert re.search(r"over \d model forms|in all \d model forms|in one model form", text)
    assert re.search(r"Supported: (yes|only as a range|no)", text)
    assert "When is the line tamped?" in text
    assert "What would narrow it" in text


@pytest.mark.parametrize("path", PLAIN, ids=[path.stem for path in PLAIN])
def test_nothing_censored_is_stated_as_a_mean(path: Path, tmp_path: Path) -> None:
    study = load_study(path).with_run(realisations=TRACKS)
    text = first_screen(made(tmp_path / "run", study, censored=True))
    assert "no price. Only 3 of 8 pairs of sections reach the limit" in text
    assert not re.search(r"(costs?|saves?) about", text)
    assert not re.search(r"\d \(−?[\d.]+ to −?[\d.]+\)", text)  # no price with an interval
    assert "Supported: no" in text


def test_date_of_tamping(tmp_path: Path) -> None:
    study = made_run.study(start_date="2026-03-01")
    text = first_screen(made(tmp_path / "run", study))
    assert "2028-01" in text  # 700 days on
    assert study.digest == made_run.study().digest
