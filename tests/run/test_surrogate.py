"""Parameter sets whose Step A is predicted: which, how well, and the same whoever asks."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from toy import FITTED, INTERVAL, LOAD, N0, SPRING, everything, table, uncertain

from mcsettle.errors import NumericalError
from mcsettle.run import left_out, train_surrogate
from mcsettle.run import training_grounds as train_grounds
from mcsettle.run.close import gather
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study
from mcsettle.run.sets_left_out import sets_left_out
from mcsettle.run.shards import parse_slice
from mcsettle.run.surrogate import ERROR, list_passages, with_errors
from mcsettle.run.surrogate_fit import surrogates_of
from mcsettle.run.train_surrogate import set_predictor
from mcsettle.run.training_grounds import computed_on, learnt_on, training_grounds
from mcsettle.step_a import transfer_cache
from mcsettle.step_a.processes import together
from mcsettle.step_a.surrogate import stacked
from mcsettle.step_a.transfers import needs, step_a, transfer_on
from mcsettle.storage.location import place
from mcsettle.storage.provenance import read_provenance
from mcsettle.study import candidates
from mcsettle.study.candidates import candidates_of
from mcsettle.study.parameter_sets import all_sets, first_sets
from mcsettle.study.study import Study
from mcsettle.study.transfer_store import transfer_store

pytestmark = pytest.mark.usefixtures("fresh_cache", "few_resamples", "small_pool")
SETS, TRACKS = 5, 3
DAMPING = SPRING | {
    "input": "trains.passenger.secondary_damping_ns_per_m",
    "distribution": "log_uniform",
    "low": 2e4,
    "high": 6e4,
}
COLUMN = "input_step_a_error_percent"


@pytest.fixture(scope="module")
def small_pool():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(candidates, "POOL", 16)
        patch.setattr(train_surrogate, "FIRST", 2)
        patch.setattr(left_out, "TRACKS", range(2))
        yield


def with_surrogate(*entries, **keys):
    run = {"realisations": TRACKS, "parameter_sets": SETS}
    return uncertain(*entries, run=run, step_a={"surrogate": True, **keys})


@pytest.fixture(scope="module")
def study():
    return with_surrogate(N0, LOAD, SPRING, DAMPING)


@pytest.fixture(scope="module")
def store(fresh_cache, small_pool, study):
    store = transfer_store(study)
    set_predictor(candidates_of(study), store)
    return store


@pytest.fixture(scope="module")
def folder(fresh_cache, small_pool, study, tmp_path_factory):
    return run_study(study, tmp_path_factory.mktemp("run") / "out").folder


def test_days_of_predicted_sets_are_those_of_computed_ones(study, folder, tmp_path):
    full = uncertain(
        N0, LOAD, SPRING, DAMPING, run={"realisations": TRACKS, "parameter_sets": SETS}
    )
    computed = run_study(full, tmp_path / "full").folder
    rows, exact = table(folder, "realisations"), table(computed, "realisations")
    keys = ["scenario", "parameter_set", "realisation"]
    rows, exact = rows.sort_values(keys), exact.sort_values(keys)
    apart = np.abs(
        rows["tamping_interval_days"].to_numpy() / exact["tamping_interval_days"].to_numpy() - 1
    )
    assert 0.0 < apart.max() < 0.01
    predicted = rows[COLUMN].to_numpy() > 0.0
    assert predicted.any()
    assert np.all(apart[~predicted] == 0.0)
    assert COLUMN not in exact.columns


def test_a_set_with_an_error_takes_the_factor_that_it_fits():
    member = all_sets(uncertain(SPRING, FITTED, observed=[INTERVAL]))[0]
    member = replace(member, values=member.values | {ERROR: 0.1})
    fitted = member.with_values({FITTED["input"]: 20.0})
    assert fitted.values == member.values | {FITTED["input"]: 20.0}
    assert fitted.study.settlement.settlement_factor == 20.0


def test_every_set_says_what_it_had(study, store, folder):
    members = with_errors(all_sets(study), store)
    for member in members:
        error = member.values[ERROR]
        assert (error > 0.0) == store.predictor.answers(member.study.scenes)
    rows = table(folder, "realisations")
    by_set = rows.groupby("parameter_set")[COLUMN].first()
    assert by_set.to_dict() == {m.index: m.values[ERROR] for m in members}
    told = read_provenance(place(folder)).surrogate
    assert told == store.predictor.training.text


def test_a_predicted_set_needs_no_step_a(study, store, monkeypatch):
    predicted = [m for m in all_sets(study) if store.predictor.answers(m.study.scenes)]
    monkeypatch.setattr(transfer_cache, "precompute", None)
    assert predicted
    for member in predicted:
        scenes = member.study.scenes
        assert needs(scenes, store) == set()
        step_a(scenes, store=store)


def test_sets_that_were_learnt_from_are_computed(study, store):
    learnt = set(store.predictor.training.sets) - {candidates.CENTRAL}
    for member in first_sets(study, candidates.POOL):
        if member.index in learnt:
            assert not store.predictor.answers(member.study.scenes)
            assert store.predictor.error_percent(member.study.scenes) == 0.0


def test_a_prediction_is_exact_where_it_was_learnt(study, store):
    predictor = store.predictor
    members = {m.index: m for m in first_sets(study, candidates.POOL)}
    scenes = members[predictor.training.sets[1]].study.scenes
    predicted, exact = predictor.predict(scenes), step_a(scenes, store=transfer_store(study))
    for pair, transfers in exact.transfers.items():
        for one, other in zip(predicted.transfers[pair], transfers, strict=True):
            for name in ("dynamic", "quasi_static", "force"):
                size = np.abs(getattr(other, name)).max()
                assert np.abs(getattr(one, name) - getattr(other, name)).max() < 1e-6 * size
            assert np.array_equal(one.geostatic, other.geostatic)


def test_an_axle_load_that_only_scales_is_no_input(study, store):
    of_speeds = store.predictor.surrogates.values()
    for surrogate in of_speeds:
        assert len(surrogate.inputs.columns) == 2  # spring and damper
    assert len({surrogate.levels[0].kriging for surrogate in of_speeds}) == 1


def test_another_process_learns_the_same(study, store, monkeypatch):
    monkeypatch.setattr(transfer_cache, "precompute", None)  # all of it lies in the cache folder
    monkeypatch.setattr(train_surrogate, "sets_left_out", None)
    again = transfer_store(study)
    assert set_predictor(candidates_of(study), again) == store.predictor.training
    for member in all_sets(study):
        scenes = member.study.scenes
        assert again.predictor.expected(scenes) == store.predictor.expected(scenes)


@pytest.mark.slow
def test_two_processes_find_the_same_errors_as_one(monkeypatch):
    given = []

    def noted(state, surrogates, processes):
        errors = sets_left_out(state, surrogates, processes)
        given.append((replace(state, days={}), surrogates, errors))
        return errors

    monkeypatch.setattr(train_surrogate, "sets_left_out", noted)
    monkeypatch.setattr(train_surrogate, "read_arrays", lambda *_: None)
    few = with_surrogate(SPRING, tolerance_points=50.0, tolerance_percent=50.0)
    set_predictor(candidates_of(few), transfer_store(few))
    state, surrogates, errors = given[-1]
    with together(2) as two:
        again = sets_left_out(state, surrogates, two)
    assert len(errors) == len(state.chosen) == len(state.days) > 2
    for one, other in zip(errors, again, strict=True):
        assert np.array_equal(one.days, other.days)
        assert np.array_equal(one.points, other.points)
        assert one.deviation == other.deviation


def test_more_sets_leave_the_earlier_ones_as_they_are(study, store):
    fewer = study.with_run(parameter_sets=2)
    again = transfer_store(fewer)
    assert set_predictor(candidates_of(fewer), again) == store.predictor.training
    for member in all_sets(fewer):
        assert with_errors([member], again) == with_errors([member], store)


def test_slices_gathered_are_a_plain_run(study, folder, tmp_path):
    out = tmp_path / "out"
    for part in ("1/2", "2/2"):
        run_study(study, out, RunOptions(shards=parse_slice(part)))
    gather(out)
    assert everything(out) == everything(folder)


def test_what_is_outside_is_computed(study, store):
    member = all_sets(study)[0]
    inside = member.study.scenes
    assert store.predictor.expected(inside) is not None
    stiffer = member.study.with_inputs({"track.support.stiffness_n_per_m2": 9e7})
    assert store.predictor.expected(stiffer.scenes) is None
    far = member.study.with_inputs({"trains.passenger.secondary_damping_ns_per_m": 4e5})
    assert store.predictor.expected(far.scenes) is None


def test_the_tolerance_decides():
    store = transfer_store(
        strict := with_surrogate(SPRING, DAMPING, tolerance_percent=1e-6, most_grounds=10)
    )
    training = set_predictor(candidates_of(strict), store)
    assert not training.met
    assert training.grounds == len(training.sets) == 10
    assert not any(store.predictor.answers(m.study.scenes) for m in all_sets(strict))


def test_nothing_to_predict_where_all_grounds_are_one():
    alone = with_surrogate(N0, LOAD)
    assert set_predictor(candidates_of(alone), transfer_store(alone)) is None


def test_quantiles_count_shares():
    errors = [
        left_out.LeftOut(0.5, np.array([1.0, 3.0]), np.array([0.2])),
        left_out.LeftOut(0.1, np.array([10.0]), np.zeros(0)),
    ]
    found = left_out.quantiles(errors, np.array([0.99, 0.01]))
    assert (found.days_median, found.days_p95, found.points_p95) == (3.0, 3.0, 0.2)
    assert left_out.errors_per_deviation(errors, np.array([0.5, 0.5])) == (100.0, 0.4)
    assert replace(found, days_median=0.0) != found


def test_a_ground_that_cannot_be_computed_is_not_learnt_from(monkeypatch):
    narrow = with_surrogate(SPRING, DAMPING, tolerance_points=0.4)
    refused = {m.index for m in first_sets(narrow, candidates.POOL) if m.index % 2}
    springs = {
        m.study.trains["passenger"].cars[0].secondary
        for m in first_sets(narrow, candidates.POOL)
        if m.index in refused
    }

    def refuses(ground, scene, service, scenes, own):
        if service.train.cars[0].secondary in springs:
            raise NumericalError("the softening does not converge")
        return transfer_on(ground, scene, service, scenes, own)

    monkeypatch.setattr(train_grounds, "transfer_on", refuses)
    training = set_predictor(candidates_of(narrow), transfer_store(narrow))
    assert len(training.sets) >= 2
    assert not refused & set(training.sets)


def test_nothing_is_learnt_from_too_few_grounds(monkeypatch):
    def refuses(*arguments):
        raise NumericalError("the softening does not converge")

    monkeypatch.setattr(train_grounds, "transfer_on", refuses)
    narrow = with_surrogate(SPRING, DAMPING)
    store = transfer_store(narrow)
    assert set_predictor(candidates_of(narrow), store) is None
    assert store.predictor is None


def study_on(root, soil):
    data = tomllib.loads((root / "studies" / "linespeed_ground.toml").read_text(encoding="utf-8"))
    data["track"]["soil"] = soil
    return Study.from_mapping(data)


def passages_on(root, soil):
    study = study_on(root, soil)
    return list_passages(study.scenes, transfer_store(study))


@pytest.mark.parametrize(("soil", "both", "speeds"), [
    ("linear", False, [None]),
    ("linear", True, [None]),
    ("equivalent_linear", False, [225]),
    ("equivalent_linear", True, [225, 201]),
])  # fmt: skip
def test_a_training_ground_has_all_speeds(root, soil, both, speeds):
    grounds = training_grounds(passages_on(root, soil), both)
    softened = [g.ground.softened and round(3.6 * g.ground.softened.speed) for g in grounds]
    assert softened == speeds
    assert len({g.ground.settings for g in grounds}) == 1
    for ground in grounds:
        assert [round(3.6 * p.service.speed) for p in ground.passages] == [201, 209, 217, 225]


def learnt_from(passages, both, store):
    grounds = training_grounds(passages, both)
    return learnt_on(grounds, [computed_on(ground, (), store) for ground in grounds])


def test_what_softening_changes_is_linear_in_the_speed(root, study, store, monkeypatch):
    like = step_a(study.scenes, store=store).transfers["base", "v201"][0]

    def on_ground(ground, scene, service, scenes, store):
        size = service.speed**2 + 3.0 * ground.softened.speed
        return replace(like, **{name: size * getattr(like, name) for name in ("force", "dynamic")})

    monkeypatch.setattr(train_grounds, "transfer_on", on_ground)
    passages = passages_on(root, "equivalent_linear")
    learnt = learnt_from(passages, True, store)
    fastest = max(passages, key=lambda p: p.service.speed)
    assert learnt.own == {fastest.key}
    for p in passages:
        exact = on_ground(p.ground, p.scene, p.service, (), store)
        found = stacked([learnt.transfers[p.key]])
        for name, change in learnt.softening.get(p.key, {}).items():
            found[name] = found[name] + change
        assert (p.key in learnt.softening) == (p is not fastest)
        for name, expected in stacked([exact]).items():
            assert np.allclose(found[name], expected, rtol=1e-12)
    assert not learnt_from(passages, False, store).softening


def test_a_second_level_predicts_what_softening_changes(root, study, store, monkeypatch):
    like = step_a(study.scenes, store=store).transfers["base", "v201"][0]

    def on_ground(ground, scene, service, scenes, store):
        soft = np.log(ground.track.layers[-1].material.youngs_modulus / 7e7)
        size = 5.0 + soft + 0.1 * service.speed + 0.02 * ground.softened.speed * (1.0 - soft)
        return replace(like, **{name: size * getattr(like, name) for name in ("force", "dynamic")})

    monkeypatch.setattr(train_grounds, "transfer_on", on_ground)
    softens = study_on(root, "equivalent_linear")
    state = train_surrogate._begun(candidates_of(softens), transfer_store(softens).emptied())
    *sets, unseen = range(14)
    state.chosen, state.both = sets, sets[::2]
    state.learnt = {c: learnt_from(state.passages[c], c % 2 == 0, store) for c in sets}
    ((*families,),) = surrogates_of(state)
    assert [len(surrogate.levels) for _, surrogate in families] == [2, 2, 2, 1]
    for family, surrogate in families:
        p, point = state.passages[unseen][family.place], family.points[[unseen]]
        exact = stacked([on_ground(p.ground, p.scene, p.service, (), store)])
        parts = [k.combined(k.kriging.weights(point)[0]) for k in surrogate.levels]
        for name in ("force", "dynamic"):
            predicted = sum(part[name] for part in parts)
            size = np.abs(exact[name]).max()
            assert np.abs(predicted - exact[name][0]).max() < 1e-6 * size
