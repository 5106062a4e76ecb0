"""``mcsettle plan``: counts, sizes and a probe, before a long run."""

import json

import pytest
import toy
from typer.testing import CliRunner

from mcsettle.cli.app import app
from mcsettle.cli.plan import plan_lines
from mcsettle.run import plan as plans
from mcsettle.run.plan import is_long, plan
from mcsettle.study.study import resolved_toml


@pytest.mark.parametrize("stepping", ["cycle_jump", "every_axle", "every_train"])
def test_a_plan_counts_what_a_run_will_write(stepping):
    """Two scenarios of 5000 tracks in batches of 2048, each a shard of two and a bit."""
    found = plan(toy.study(run={"realisations": 5000, "stepping": stepping}))
    assert (found.rows, found.scenarios, found.variants, found.batches) == (10_000, 2, 1, 6)
    assert (found.batch, found.modes, found.stepping) == (2048, 20, stepping)
    assert found.seconds > 0.0
    assert 0.5 < found.disk_mb < 5.0
    assert 400.0 < found.memory_mb < 1000.0
    # some weeks of traffic until the limit
    assert 1e4 < found.passages / found.rows < 1e6
    assert "10000 = 5000 realisations × 2 scenarios × 1 variants" in next(plan_lines(found))


@pytest.mark.parametrize(
    ("run", "expected"),
    [
        ({"realisations": 1000}, False),
        ({"realisations": 100_001}, True),
        ({"realisations": 51, "stepping": "every_axle"}, True),
        ({"realisations": 50, "right_hand_side": "pointwise"}, False),
        ({"realisations": 51, "right_hand_side": "pointwise"}, True),
    ],
)
def test_what_counts_as_long(run, expected):
    assert is_long(toy.study(run=run)) is expected


def test_the_command_prints_json(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(resolved_toml(toy.study()), encoding="utf-8")
    done = CliRunner().invoke(app, ["plan", str(path), "--realisations", "30", "--json"])
    assert done.exit_code == 0, done.stderr
    assert json.loads(done.stdout)["rows"] == 60
    refused = CliRunner().invoke(app, ["plan", str(path), "--realisations", "99000000"])
    assert refused.exit_code == 2


def test_a_plan_is_of_the_processes_that_the_run_will_have(monkeypatch):
    """One thread each, and a share of the time: Taichi keeps the threads that the probe starts."""
    asked = []
    monkeypatch.setattr(plans, "_probe", lambda *given: asked.append(given[-1]) or (1.0, 10.0))
    study = toy.study(run={"realisations": 20_000})
    alone, both = (plan(study, 2, processes=n) for n in (1, 2))
    assert asked == [2, 2, 1, 1]
    rest = plans.FIXED_SECONDS + plans.SUMMARY_SECONDS * alone.rows
    assert both.seconds - rest == pytest.approx(0.5 * (alone.seconds - rest))
