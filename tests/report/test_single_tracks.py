"""What a report computes again: single tracks agree with the run, and pictures of the track are there."""

from pathlib import Path

import numpy as np
import pytest
import toy

from mcsettle.report import pictures
from mcsettle.report.build import read_report
from mcsettle.report.material import Material, read_material
from mcsettle.report.render import html
from mcsettle.report.single_tracks import (
    mixed_days,
    mixed_scenario,
    profiles_at_limit,
)
from mcsettle.run.pipeline import run_study
from mcsettle.step_a.transfers import step_a

TRAINS = {
    "passenger": {"vehicle": "passenger", "cars": 2},
    "freight": {"vehicle": "freight", "cars": 2},
}
BASE = [{"train": "passenger", "speed_kmh": 200.0, "per_day": 72}]
MIXED = [*BASE, {"train": "freight", "speed_kmh": 97.0, "per_day": 24}]


@pytest.fixture(scope="module")
def run(fresh_cache, tmp_path_factory) -> Path:
    """Five realisations of a day of passenger trains, and of one with freight trains."""
    study = toy.study(
        trains=TRAINS,
        scenarios=[{"name": "A", "timetable": BASE}, {"name": "C", "timetable": MIXED}],
        economics={"effect": "tonnage", "baseline": "A"},
        run={"realisations": 5},
    )
    folder = tmp_path_factory.mktemp("mixed") / "run"
    run_study(study, folder)
    return folder


@pytest.fixture(scope="module")
def material(run: Path) -> Material:
    return read_material(run)


def test_profiles_are_those_of_the_run(material: Material) -> None:
    shown = profiles_at_limit(material, step_a(material.study.scenes))
    table = material.results.realisations
    first = table[table["realisation"] == 0].set_index("scenario")
    study = material.study
    for profile, scenario in zip(shown, ("A", "C"), strict=True):
        # The same address is the same track: to the last digit.
        assert profile.days == first.loc[scenario, "tamping_interval_days"]
        # Over a whole window the profile's SD is the one that stopped it.
        assert np.std(profile.final[:-1]) == pytest.approx(study.limit.sd_limit_mm, rel=1e-6)
        assert np.std(profile.initial[:-1]) == pytest.approx(study.profile.sd_mm, rel=1e-6)


def test_mixed_traffic_follows_the_timetable(material: Material) -> None:
    assert mixed_scenario(material) == "C"
    view = mixed_days(material, "C", step_a(material.study.scenes))
    assert (view.days[0], view.days[-1]) == (2.0, 4.0)
    assert np.all(np.isfinite(view.sd))
    assert [name for name, _, _ in view.blocks] == ["passenger", "freight"] * 2
    # 72 of the 96 passages of a day are passenger trains'.
    assert view.blocks[0][1:] == pytest.approx((2.0, 2.75))
    assert view.blocks[-1][1:] == pytest.approx((3.75, 4.0))
    study = material.study
    assert study.profile.sd_mm < view.sd[0] < study.limit.sd_limit_mm


def test_report_has_the_pictures_of_the_track(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    everything = pictures.track_figures

    def quick(case, table):
        own = everything(case, table)
        return {name: own[name] for name in ("stress_depth", "stress_along")}

    monkeypatch.setattr(pictures, "track_figures", quick)
    page = read_report(run, with_track=True)
    names = [picture.name for picture in page.pictures]
    for name in ("profiles", "mixed", "force", "stress_map", "stress_depth", "stress_along"):
        assert name in names
    text = html(page)
    assert all(f'id="picture-{name}"' in text for name in names)
