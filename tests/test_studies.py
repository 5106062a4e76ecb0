"""Every study that is shipped runs, cut down and on the closed-form track; so does the tour."""

import os
import re
import tomllib
from pathlib import Path

import pytest

from mcsettle.study.study import Study, load_study, resolved_toml

ROOT = Path(__file__).resolve().parents[1]
STUDIES = sorted((ROOT / "studies").glob("*.toml"))
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def small(path: Path) -> Study:
    """The study at ``path`` with short trains on the beam, its first two scenarios and one variant."""
    study = load_study(path)
    data = tomllib.loads(resolved_toml(study))
    data["track"] = {"model": "beam"}
    names = [scenario["name"] for scenario in data["scenarios"][:2]]
    data["scenarios"] = data["scenarios"][:2]
    data["variants"] = [{"name": data["variants"][0]["name"]}]
    for key in ("reference", "calibration", "uncertain", "correlations", "observed", "sources"):
        data.pop(key, None)
    sides = [(e["scenario"], e["baseline"]) for e in data.get("effects", [])]
    if sides:
        data["effects"] = [
            e for e, pair in zip(data["effects"], sides, strict=True) if {*pair} <= {*names}
        ]
    elif data.get("economics", {}).get("baseline", names[0]) not in names:
        data.pop("economics", None)
    for train in data["trains"].values():
        train["cars"] = 1
        train.pop("consist", None)
    data["run"] = {"realisations": 2}
    data["settlement"] = {"settlement_factor": 300.0}
    data["limit"] |= {"horizon_years": 0.5}
    if "grounds" in data:
        data["run"]["parameter_sets"] = 2
    return Study.from_mapping(data, str(path), path.parent)


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_every_study_runs_at_a_small_size(path: Path, tmp_path: Path, fresh_cache: Path) -> None:
    from mcsettle import run_study, summarise

    study = small(path)
    finished = run_study(study, tmp_path / "out")
    assert finished.closed
    assert finished.n_failed == 0
    assert len(summarise(finished.folder)) >= 1


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_every_study_is_listed(path: Path) -> None:
    assert f"`{path.name}`" in (ROOT / "studies" / "README.md").read_text(encoding="utf-8")


def blocks(page: Path, language: str) -> list[str]:
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_examples_in_the_pages_can_be_read(page: Path) -> None:
    for text in blocks(page, "toml"):
        tomllib.loads(text)
    for text in blocks(page, "python"):
        compile(text, page.name, "exec")


def test_the_tour_of_the_readme_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh_cache: Path, capsys
) -> None:
    """As it stands, in a folder of its own, with fewer tracks."""
    (tour,) = [text for text in blocks(ROOT / "README.md", "python") if "import mcsettle" in text]
    (tmp_path / "studies").mkdir()
    (tmp_path / "results").mkdir()
    text = (ROOT / "studies" / "toy.toml").read_text(encoding="utf-8")
    text = text.replace("realisations = 32\nhistory", "realisations = 3\nhistory")
    (tmp_path / "studies" / "toy.toml").write_text(text.replace("cars = 11", "cars = 2"))
    monkeypatch.chdir(tmp_path)
    exec(compile(tour, "README", "exec"), {"__name__": "tour"})
    shown = capsys.readouterr().out
    assert "passenger: 2 cars, 8 axles, 136 t" in shown
    assert "beam track" in shown
    assert "tamping_interval_days" in shown
    assert os.path.getsize(tmp_path / "results" / "toy.png") > 10_000


@pytest.mark.parametrize("study", ["linespeed", "traffic"])
def test_factors_were_found_for_these_transfer_functions(study: str) -> None:
    """A change of what identifies a train must not disown the studies' factors."""
    from mcsettle.run.factor_digest import factor_warnings

    assert factor_warnings(load_study(ROOT / "studies" / f"{study}.toml")) == []
