"""Uncertain inputs of a study: what is accepted, what is refused, and the draws."""

import os
import tomllib
from pathlib import Path

import numpy as np
import pytest
import toy
from scipy import stats
from toy import LOAD, N0

from mcsettle.errors import InputError
from mcsettle.step_a.transfer_file import keep_newest
from mcsettle.study.key_paths import number_paths, replaced, steps_to
from mcsettle.study.parameter_sets import all_sets, draws, unit_draws
from mcsettle.study.study import Study, load_study, resolved_toml

RATE = {
    "input": "economics.discount_rate",
    "distribution": "pert",
    "low": 0.015,
    "mode": 0.035,
    "high": 0.05,
}


def study(*uncertain, **changes):
    return toy.study(uncertain=[dict(entry) for entry in uncertain], **changes)


def refused(*uncertain, **changes) -> str:
    with pytest.raises(InputError) as caught:
        study(*uncertain, **changes)
    return str(caught.value)


def test_a_study_without_is_what_it_was():
    plain = toy.study()
    assert plain.n_sets == 1
    (only,) = all_sets(plain)
    assert only.study is plain
    assert only.values == {}
    assert "uncertain" not in resolved_toml(plain)


def test_it_reads_back_equal():
    once = study(
        N0, LOAD, RATE, correlations=[{"inputs": [LOAD["input"], RATE["input"]], "rank": 0.4}]
    )
    again = Study.from_mapping(tomllib.loads(resolved_toml(once)))
    assert again == once
    assert again.digest == once.digest
    assert [m.values for m in all_sets(again)] == [m.values for m in all_sets(once)]
    assert once.n_sets == 64


def test_digest():
    """Distributions decide results; their sources and the number of sets do not."""
    base = study(N0)
    assert study({**N0, "source": "Li and Selig"}).digest == base.digest
    assert study(N0, run={"parameter_sets": 8}).digest == base.digest
    assert study({**N0, "low": 2e4}).digest != base.digest
    assert toy.study().digest != base.digest


def test_values_reach_the_model():
    """Both keys of an entry, a variant without its own value, and what follows from a train."""
    variants = [{"name": "base"}, {"name": "own", "ballast_cycles_before": 5e5}]
    one = study(N0, LOAD, RATE, variants=variants)
    member = all_sets(one)[3]
    n0, load = member.values[N0["input"]], member.values[LOAD["input"]]
    assert 3e4 < n0 < 1e6
    settings = member.study.settlement_settings("base")
    assert settings.ballast_cycles_before == settings.subgrade_cycles_before == n0
    own = member.study.settlement_settings("own")
    assert (own.ballast_cycles_before, own.subgrade_cycles_before) == (5e5, n0)
    assert member.study.trains["passenger"].cars[0].axle_load == pytest.approx(1e3 * load)
    assert member.study.mgt_per_day("v201") == pytest.approx(12 * load * 72 / 1e6)
    assert member.study.economics.discount_rate == member.values[RATE["input"]]
    assert not member.study.uncertain


def test_lists_are_reached_by_name_and_place():
    speed = {
        "input": "scenarios.v225.timetable.1.speed_kmh",
        "distribution": "uniform",
        "low": 220,
        "high": 230,
    }
    count = {
        "input": "scenarios.v201.timetable.1.per_day",
        "distribution": "discrete",
        "values": [70.0, 72.0],
    }
    member = all_sets(study(speed, count, run={"parameter_sets": 4}))[1]
    assert member.study.timetable("v225").services[0].speed * 3.6 == pytest.approx(
        member.values[speed["input"]]
    )
    assert member.study.timetable("v201").services[0].per_day in (70, 72)


def test_a_row_is_an_address():
    """More sets leave the earlier ones, another seed does not, nor do sources or titles."""
    few, many = (
        study(N0, LOAD, run={"parameter_sets": 5}),
        study(N0, LOAD, run={"parameter_sets": 50}),
    )
    np.testing.assert_array_equal(draws(few)[1], draws(many)[1][:5])
    assert not np.array_equal(draws(study(N0, LOAD, seed=2))[1][:5], draws(few)[1])


def test_draws_are_spread_evenly():
    """Of 64 scrambled Sobol points one falls into every 64th, for every input."""
    shares = unit_draws(study(N0, LOAD, RATE))
    for column in shares.T:
        assert sorted(np.floor(64 * column).astype(int)) == list(range(64))


@pytest.mark.parametrize("rank", [-0.5, 0.8])
def test_rank_correlation(rank):
    """Spearman's over 4096 draws: the sequence is even, 0.01 is ample."""
    pair = [{"inputs": [N0["input"], LOAD["input"]], "rank": rank}]
    one = study(N0, LOAD, RATE, correlations=pair, run={"parameter_sets": 64})
    _, drawn = draws(one, 4096)
    assert stats.spearmanr(drawn[:, 0], drawn[:, 1]).statistic == pytest.approx(rank, abs=0.01)
    assert stats.spearmanr(drawn[:, 0], drawn[:, 2]).statistic == pytest.approx(0.0, abs=0.01)
    np.testing.assert_allclose(  # the marginal stays
        np.quantile(drawn[:, 1], [0.1, 0.9]), stats.norm(17, 0.85).ppf([0.1, 0.9]), rtol=1e-3
    )


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        (
            {**N0, "input": "settlement.balast_cycles_before"},
            "did you mean 'settlement.ballast_cycl",
        ),
        ({**N0, "input": "track.layers.clay.settlement_b"}, "did you mean 'track.layers"),
        ({**N0, "input": "limit.horizon_years"}, "same in every parameter set"),
        ({**N0, "input": "settlement.stress"}, "no number"),
        ({**N0, "input": "run.realisations"}, "no input"),
        ({**N0, "also": [N0["input"]]}, "more than once"),
        ({**N0, "distribution": "gauss"}, "accepted|did you mean"),
        ({**N0, "high": None}, "needs high"),
        (
            {
                "input": "track.support.poisson",
                "distribution": "normal",
                "mean": 0.45,
                "sd": 0.05,
            },
            "less than 0.5.*at_most",
        ),
        (
            {
                "input": "track.layers.subgrade.strength_pa",
                "distribution": "normal",
                "mean": 250e3,
                "sd": 80e3,
            },
            "greater than 0",
        ),
        (
            {"input": "profile.sd_mm", "distribution": "uniform", "low": 1.0, "high": 1.6},
            "must exceed profile.sd_mm",
        ),
        (
            {
                "input": "scenarios.v201.timetable.1.per_day",
                "distribution": "uniform",
                "low": 70,
                "high": 74.5,
            },
            "per_day",
        ),
    ],
)
def test_impossible_inputs_are_refused(entry, said):
    text = refused({k: v for k, v in entry.items() if v is not None})
    assert "uncertain" in text
    import re

    assert re.search(said, text.replace("\n", " ")), text


def test_inputs_without_effect_are_refused():
    variants = [{"name": "a", "settlement_factor": 2.0}, {"name": "b", "settlement_factor": 3.0}]
    entry = {
        "input": "settlement.settlement_factor",
        "distribution": "lognormal",
        "median": 300,
        "cov": 0.1,
    }
    assert "every variant has its own" in refused(entry, variants=variants)
    assert "without [[uncertain]]" in refused(run={"parameter_sets": 8})


def test_correlations_that_cannot_be_are_refused():
    names = [N0["input"], LOAD["input"], RATE["input"]]
    pairs = [(0, 1, 0.9), (1, 2, 0.9), (0, 2, -0.9)]
    table = [{"inputs": [names[i], names[j]], "rank": rank} for i, j, rank in pairs]
    assert "not positive definite" in refused(N0, LOAD, RATE, correlations=table)
    assert "no uncertain input" in refused(N0, LOAD, correlations=table[1:2])
    assert "each pair once" in refused(N0, LOAD, correlations=[table[0], table[0]])


def test_a_draw_that_cannot_be_is_told_with_its_set():
    """Each end is possible alone; together the SD lies above the limit."""
    sd = {"input": "profile.sd_mm", "distribution": "uniform", "low": 1.0, "high": 1.45}
    limit = {"input": "limit.sd_limit_mm", "distribution": "uniform", "low": 1.1, "high": 1.6}
    with pytest.raises(InputError, match=r"parameter set \d+ cannot be used"):
        all_sets(study(sd, limit))


def test_key_paths():
    data = {"a.b": {"c": 1}, "list": [{"name": "x.y", "v": 2.0}, {"v": True}]}
    assert steps_to(data, "a.b.c") == ("a.b", "c")
    assert steps_to(data, "list.x.y.v") == ("list", 0, "v")
    assert steps_to(data, "list.3.v") is None
    assert list(number_paths(data)) == ["a.b.c", "list.x.y.v"]
    changed = replaced(data, ("list", 0, "v"), 3.0)
    assert (changed["list"][0]["v"], data["list"][0]["v"]) == (3.0, 2.0)


@pytest.mark.parametrize(
    "name", ["linespeed_uncertain", "traffic_uncertain", "linespeed_observed", "linespeed_ground"]
)
def test_the_shipped_studies_are_sound_and_sourced(root: Path, name: str):
    loaded = load_study(root / "studies" / f"{name}.toml")
    assert all(entry.source for entry in loaded.uncertain)
    assert len(all_sets(loaded)) == loaded.n_sets >= 64


def test_the_cache_keeps_what_was_used_last(tmp_path: Path):
    for place in range(5):
        (tmp_path / f"transfer-{place}.npz").write_bytes(bytes(100))
        os.utime(tmp_path / f"transfer-{place}.npz", ns=(place, place))
    (tmp_path / "basis-0.npz").write_bytes(bytes(1000))
    os.utime(tmp_path / "transfer-1.npz", ns=(9, 9))
    keep_newest(tmp_path, "transfer-*.npz", 250)
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "basis-0.npz",
        "transfer-1.npz",
        "transfer-4.npz",
    ]
    keep_newest(tmp_path, "transfer-*.npz", 1)
    assert [p.name for p in tmp_path.glob("transfer-*")] == ["transfer-1.npz"]
