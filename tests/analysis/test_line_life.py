"""Sections of a line tamped again and again: intervals, cost, persistence, refusals, the command."""

import json
from datetime import date, timedelta
from typing import Any

import numpy as np
import pandas as pd
import pytest
import toy
from typer.testing import CliRunner

from mcsettle.analysis.line_draws import line_draws
from mcsettle.analysis.line_life import LineLife, line_life
from mcsettle.analysis.sections import sections_report
from mcsettle.cli.app import app
from mcsettle.errors import InputError
from mcsettle.step_a.transfers import step_a
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.study.study import Study, load_study, resolved_toml

pytestmark = pytest.mark.usefixtures("fresh_cache")
DAYS, N, DRAWS = (0, 6, 12), 5, 6
HORIZON = 0.4  # years: some four tampings
LINEAR = {"recovery": "linear", "intercept_mm": 0.6, "slope": 0.2, "cycles": 30}


def line_study(
    folder, maintenance: dict[str, Any] | None = None, growth="model", days=DAYS, **changes
) -> Study:
    rows = ["chainage_from_m,chainage_to_m,date,sd_mm"]
    for section in range(N):
        for day in days:
            sd = (1.36 if section == 1 else 0.8 + 0.05 * section) + 0.013 * day
            when = date(2024, 1, 1) + timedelta(days=day)
            rows.append(f"{200 * section},{200 * section + 200},{when},{sd:.4f}")
    (folder / "sds.csv").write_text("\n".join(rows), encoding="utf-8")
    line = {"sd_file": "sds.csv", "scenario": "v201", "sd_error_mm": 0.03, "growth": growth}
    study = toy.study(
        line=line | changes.pop("line", {}),
        maintenance=LINEAR if maintenance is None else maintenance,
        limit={"horizon_years": HORIZON},
        **changes,
    )
    (folder / "study.toml").write_text(resolved_toml(study), encoding="utf-8")
    return load_study(folder / "study.toml")


@pytest.fixture(scope="module")
def life(fresh_cache, tmp_path_factory) -> LineLife:
    return line_life(line_study(tmp_path_factory.mktemp("line")), DRAWS)


def test_tampings_are_those_of_step_b_one_after_the_other(life, tmp_path):
    """Each section of a draw by itself, from first run to horizon, as ``life`` would follow it."""
    study = line_study(tmp_path)
    report = sections_report(study)
    forecast, history = report.forecast, report.line.history
    scene = study.scene("base", "v201")
    engine = CycleJump(build_case(scene, step_a([scene])))
    draw = list(line_draws(forecast, DRAWS, study.seed))[3]
    for row in (0, 2, 4):
        factor = np.exp(forecast.factors.logs[draw.rate[row]])
        sd = history.sd[row, 0] + np.array([-1, 0, 1])[draw.start[row]] * np.sqrt(3) * 0.03e-3
        profile = scene.profiles.sample(range(row, row + 1))
        profile = profile * (sd / engine.measure.sd(profile))[:, None]
        day, found = -float(DAYS[-1]), []
        while True:
            gone = np.array([day + DAYS[-1]])
            outcome = engine.run(profile, np.zeros(0), np.array([factor]), gone)
            day = max(day + float(outcome.days[0]), 0.0) if outcome.reached[0] else np.inf
            if day >= forecast.horizon:
                break
            found.append(day)
            profile = outcome.amplitudes * ((0.6 + 0.2 * 1.5) / 1.5)
        ours = life.days[3, row]
        np.testing.assert_allclose(ours[~np.isnan(ours)], found, rtol=2e-3, atol=0.02)
        assert len(found) >= 2
        # The first date is that of the table of sections, but for its interpolation between factors.
        first = forecast.days[row, draw.start[row], draw.rate[row]]
        assert found[0] + DAYS[-1] == pytest.approx(first + DAYS[-1], rel=0.02)


def test_cost_and_kilometres_add_up(life):
    assert life.count.shape == (DRAWS, N)
    rate, years = life.discount_rate, life.days / 365.0
    own = [
        [5625.0 * 0.2 * sum(np.exp(-rate * t) for t in section if t == t) for section in draw]
        for draw in years
    ]
    np.testing.assert_allclose(life.cost, own, rtol=1e-12)
    np.testing.assert_allclose(life.totals["cost"], life.cost.sum(axis=1))
    np.testing.assert_allclose(life.totals["tamped_km"], 0.2 * life.count.sum(axis=1))
    table = life.table()
    assert sorted(table["chainage_from_m"]) == [200.0 * i for i in range(N)]
    assert table["cost_mean"].is_monotonic_decreasing
    assert (table["tampings_p05"] <= table["tampings_p95"]).all()
    assert life.by_year()["due_km_p50"].iloc[0] == pytest.approx(life.totals["tamped_km"].median())
    assert not life.is_open.any()


def test_a_section_beyond_its_limit_is_tamped_at_once_from_what_it_is(life, tmp_path):
    assert np.all(life.days[:, 1, 0] == 0.0)
    assert np.all(life.days[:, [0, 2, 3, 4], 0] > 0.0)
    # It was rougher than the limit, and is left rougher than by a tamping at the limit.
    deeper = line_life(line_study(tmp_path, LINEAR | {"slope": 0.0, "intercept_mm": 0.9}), DRAWS)
    assert np.all(np.diff(life.days[:, 1])[:, 0] < np.diff(deeper.days[:, 1])[:, 0])


def test_by_hand_an_interval_is_the_inverse_of_growth(tmp_path):
    """Of a power of time: alike from the second on, shorter by the damage of each tamping."""
    damaged = LINEAR | {"damage_per_tamping": 0.1}
    # A single run does not tell the forms apart.
    found = line_life(line_study(tmp_path, damaged, "average", days=(0,)), 40)
    names = [form.name for form in found.forecast.forms]
    draws = list(line_draws(found.forecast, 40, 1))
    seen = 0
    for draw, days in zip(draws, found.days, strict=True):
        power = {"straight": 1.0, "root of time": 0.5}.get(names[draw.form])
        if power is None:
            continue
        for section in (0, 2, 3):
            own = np.diff(days[section][~np.isnan(days[section])])
            if len(own) > 1:
                seen += 1
                np.testing.assert_allclose(own[1:] / own[:-1], 1.1 ** (-1.0 / power), rtol=1e-9)
    assert seen > 5


def test_shape_and_support_persist_as_the_study_says(tmp_path):
    field = {"cov": 0.2, "correlation_length_m": 5.0}
    lives = {
        "same": (LINEAR, field),
        "redrawn": (LINEAR | {"shape": "redrawn"}, field),
        "faded": (LINEAR, field | {"persistence": 0.0}),
    }
    days = {
        name: line_life(line_study(tmp_path, table, spatial_variability=own), 2).days
        for name, (table, own) in lives.items()
    }
    for name in ("redrawn", "faded"):
        np.testing.assert_array_equal(days["same"][..., 0], days[name][..., 0])
        assert not np.allclose(days["same"][..., 1], days[name][..., 1], rtol=1e-3, equal_nan=True)


def test_what_comes_after_a_tamping_differs_between_draws():
    """A field that fades: the past is the section's own, the future each draw's."""
    study = toy.study(
        spatial_variability={"cov": 0.2, "correlation_length_m": 5.0, "persistence": 0.5}
    )
    support, sd = study.scene("base", "v201").support, np.array([1e-3])
    past = support.sample(1, [7], sd, 1)[0]
    here, there = (support.sample(1, [7], sd, 2, (1, [address]))[0] for address in (70, 71))
    np.testing.assert_array_equal(support.sample(1, [7], sd, 1, (1, [70]))[0], past)
    assert not np.allclose(here, there)
    np.testing.assert_array_equal(
        support.sample(1, [7], sd, 2, (1, [7]))[0], support.sample(1, [7], sd, 2)[0]
    )


@pytest.mark.parametrize(
    ("table", "line", "said"),
    [
        ({"recovery": "perfect"}, {}, "in service"),
        (LINEAR | {"renewal_years": 30.0}, {}, "leave renewal_years out"),
        (
            LINEAR,
            {"stretches": [{"chainage_from_m": 0, "chainage_to_m": 400, "sd_limit_mm": 0.7}]},
            "at the lowest limit along the line, 0.7 mm, leaves 0.74 mm",
        ),
    ],
)
def test_what_a_line_cannot_be_kept_by_is_refused(tmp_path, table, line, said):
    with pytest.raises(InputError, match=said):
        line_life(line_study(tmp_path, table, line=line), 2)


def test_the_command(tmp_path):
    line_study(tmp_path)
    call = ["life", str(tmp_path / "study.toml"), "--realisations", "4"]
    done = CliRunner().invoke(app, [*call, "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.stderr
    assert f"{N} sections, 1 km, tamped again and again for 0.4 years" in done.stdout
    assert max(len(line) for line in done.stdout.splitlines()) <= 100
    sections = pd.read_parquet(tmp_path / "out" / "section_lives.parquet")
    assert len(sections) == N
    assert len(pd.read_parquet(tmp_path / "out" / "line_lives.parquet")) == 4
    told = json.loads(CliRunner().invoke(app, [*call, "--json"]).stdout)
    assert told["line"]["cost"]["mean"] == pytest.approx(sections["cost_mean"].sum())
    first = {row["chainage_from_m"]: row["first_p50"] for row in told["sections"]}
    assert first[200.0] == "2024-01-13"
