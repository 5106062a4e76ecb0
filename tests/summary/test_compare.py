"""Two runs side by side: paired where they share tracks, and only there."""

import json
from pathlib import Path

import made_run
import numpy as np
import pytest
from typer.testing import CliRunner

from mcsettle.cli.app import app
from mcsettle.errors import InputError
from mcsettle.summary.compare import compare
from mcsettle.summary.results import read_results

DAYS = np.linspace(500.0, 900.0, 41)
SPEED = {"v201": DAYS, "v225": 0.8 * DAYS}


def run(folder: Path, days=None, **changes) -> Path:
    return made_run.write(folder, made_run.study(**changes), SPEED if days is None else days)


def test_a_run_against_itself_changes_nothing(tmp_path: Path) -> None:
    results = read_results(run(tmp_path / "a"))
    found = compare(results, results)
    assert (found.differences, found.only, found.shared, found.unpaired) == ((), (), 41, "")
    assert [e.value for row in found.rows for e in row.change] == [0.0] * 3 * len(found.rows)


def test_pairs_find_what_intervals_hide(tmp_path: Path) -> None:
    # 1 % on every track: far less than the error of either median, and known exactly.
    longer = {name: 1.01 * d for name, d in SPEED.items()}
    settlement = {"settlement_factor": 19.2}
    first = read_results(run(tmp_path / "a"))
    second = read_results(run(tmp_path / "b", longer, settlement=settlement))
    found = compare(first, second)
    paths = {d.path: (d.first, d.second) for d in found.differences}
    assert set(paths) == {"settlement.settlement_factor", "variants.base.settlement_factor"}
    assert set(paths.values()) == {(19.433, 19.2)}
    row = found.rows[0]
    assert row.second.value - row.first.value < row.first.standard_error
    assert [e.value for e in row.change] == pytest.approx([1.0] * 3, abs=1e-9)
    reduction = next(r for r in found.rows if r.metric == "reduction_percent")
    assert [e.value for e in reduction.change] == pytest.approx([0.0] * 3, abs=1e-9)


def test_censored_pairs_bound_the_change(tmp_path: Path) -> None:
    # Where the second run outlives the horizon the change is large, whatever it is.
    never = {"v201": np.where(DAYS > 850.0, np.nan, DAYS), "v225": SPEED["v225"]}
    found = compare(read_results(run(tmp_path / "a")), read_results(run(tmp_path / "b", never)))
    low, middle, high = found.rows[0].change
    assert (low.value, middle.value) == (0.0, 0.0)
    assert middle.n_censored == 5
    assert high.value is None
    assert "worst case" in high.note


def test_other_tracks_are_not_paired(tmp_path: Path) -> None:
    found = compare(read_results(run(tmp_path / "a")), read_results(run(tmp_path / "b", seed=2)))
    assert found.unpaired == "seeds 1 and 2: other realisations"
    assert all(row.change == () for row in found.rows)
    other = read_results(run(tmp_path / "c", profile={"sd_mm": 1.1}))
    assert "profiles" in compare(read_results(tmp_path / "a"), other).unpaired


def test_runs_without_anything_in_common_are_refused(tmp_path: Path) -> None:
    other = made_run.write(tmp_path / "b", made_run.tonnage_study(), {"A": DAYS, "C": DAYS})
    with pytest.raises(InputError, match="no variant and scenario of the same names"):
        compare(read_results(run(tmp_path / "a")), read_results(other))


def test_compare_command(tmp_path: Path) -> None:
    folders = [str(run(tmp_path / "a")), str(run(tmp_path / "b", {k: 1.1 * d for k, d in
                                                                   SPEED.items()}))]  # fmt: skip
    done = CliRunner().invoke(app, ["compare", *folders])
    assert done.exit_code == 0, done.output
    for part in ("same inputs", "tamping_interval_days", "10.0 %", "41 common realisations"):
        assert part in done.stdout
    data = json.loads(CliRunner().invoke(app, ["compare", *folders, "--json"]).stdout)
    assert data["rows"][0]["change"][1]["value"] == pytest.approx(10.0)
    assert data["shared"] == 41
