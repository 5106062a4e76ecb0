"""Keys of the model forms: what a study builds of them, what variants change, what is refused."""

import numpy as np
import pytest
import toy

from mcsettle.errors import InputError
from mcsettle.railway.rail_loads import RailLoads
from mcsettle.run.options import RunOptions
from mcsettle.step_b.case import support_of
from mcsettle.summary.results import read_results

FIELD = {"cov": 0.2, "correlation_length_m": 5.0}


def faults(**changes) -> str:
    with pytest.raises(InputError) as error:
        toy.study(**changes)
    return str(error.value)


def test_a_study_without_forms_has_none():
    scene = toy.study().scenes[0]
    assert scene.rail_loads == RailLoads()
    assert scene.support.settings is None
    assert support_of(scene, range(2), scene.profiles.sample(range(2))).fields is None
    same = toy.study(spatial_variability={"cov": 0.0, "correlation_length_m": 5.0}).scenes[0]
    assert same.support.multipliers is None


def test_variants_change_key_by_key():
    study = toy.study(
        spatial_variability=FIELD | {"profile_correlation": 0.5},
        variants=[
            {"name": "as_is"},
            {"name": "more", "spatial_variability": {"cov": 0.1, "layers": {"sub_ballast": 0.5}}},
            {"name": "shape", "spatial_variability": {"spectrum": "profile"}},
            {"name": "none", "spatial_variability": {"cov": 0.0}},
            {
                "name": "paper",
                "rail_bending_share": 0.5,
                "load_per_rail": "whole",
                "section_log_sd": 0.3,
                "trains": {"passenger": {"car_length_m": 22.7}},
            },
        ],
    )
    found = {name: study.scene(name, "v201") for name in study.variant_names}
    assert found["as_is"].support.settings.cov == 0.2
    assert found["more"].support.settings.profile_correlation == 0.5
    np.testing.assert_array_equal(found["more"].support.multipliers, [[1.0, 0.5, 1.0]])
    assert found["shape"].support.settings.correlation_length is None
    assert found["none"].support.settings is None
    assert found["paper"].rail_loads == RailLoads(0.5, True)
    assert found["paper"].support.section_log_sd == 0.3
    assert found["paper"].timetable.services[0].train.cars[0].length == 22.7
    assert found["as_is"].timetable.services[0].train.cars[0].length == 25.9
    keys = {study.step_b_key(name, "v201") for name in study.variant_names}
    assert len(keys) == 5


def test_the_reference_is_the_baselines_first_service():
    assert toy.study().reference_scenario == "v201"
    data = toy.study().model_dump(by_alias=True, exclude_none=True, mode="json")
    data.pop("economics")
    assert type(toy.study()).from_mapping(data).reference_scenario == "v201"


def test_inputs_of_the_forms_may_be_uncertain():
    entry = {"input": "spatial_variability.cov", "distribution": "uniform", "low": 0.1, "high": 0.2}
    assert toy.uncertain(entry, spatial_variability=FIELD).uncertain
    wide = toy.study, entry | {"high": 0.9}
    with pytest.raises(InputError, match="negative in"):
        toy.uncertain(wide[1], spatial_variability=FIELD)


@pytest.mark.parametrize(
    ("table", "text"),
    [
        ({"correlation_length_m": 5.0}, "spatial_variability.cov: is missing"),
        ({"cov": 0.2}, "has neither correlation_length_m"),
        (FIELD | {"spectrum": "profile"}, "has both"),
        (FIELD | {"cov": 0.4}, "negative in"),
        (FIELD | {"profile_correlation": 1.5}, "profile_correlation"),
        (FIELD | {"layers": {"ballst": 1.0}}, "did you mean 'ballast'"),
        (FIELD | {"layers": {"ballast": 0.0, "sub_ballast": 0.0, "subgrade": 0.0}}, "no layer"),
        (FIELD | {"reference_sd_mm": 0.3}, "after reference_sd_mm"),
        (FIELD | {"distribution": "lognormal", "layers": {"ballast": 2.0}}, "at most 1"),
        (FIELD | {"distribution": "lognormal", "cov": 9.0}, "lognormal field of these waves"),
    ],
)
def test_fields_that_cannot_be(table, text):
    assert text in faults(spatial_variability=table)


@pytest.mark.parametrize(
    ("table", "text"),
    [
        ({"cycles": "equivalent"}, "equivalence_exponent: is missing"),
        ({"cycles": "equivalent"}, "equivalence_history: is missing"),
        ({"equivalence_exponent": 3.0}, "has no meaning without cycles"),
        (
            {"cycles": "equivalent", "equivalence_exponent": "law", "equivalence_history": "mix"},
            "ballast_equivalence_exponent: is missing",
        ),
        ({"long_run_strength": 1.0}, "without long_run_cycles"),
        ({"long_run_cycles": 1e6, "cycles": "per_vehicle"}, "'shared' or 'equivalent'"),
    ],
)
def test_counts_that_cannot_be(table, text):
    assert text in faults(settlement={"settlement_factor": toy.FACTOR} | table)


def test_loads_that_cannot_be():
    text = faults(
        variants=[{"name": "a", "trains": {"pasenger": {"car_length_m": 22.7}}}],
        track={"rail_bending_share": 1.5},
        spatial_variability={"cov": 0.2},
    )
    assert "did you mean 'passenger'" in text
    assert "rail_bending_share" in text
    assert "has neither" in text  # every fault at once


@pytest.mark.parametrize(
    ("distribution", "said"),
    [
        ("gaussian", "that is 5.92, and a gaussian"),
        ("lognormal", "received a cov of 0.1; a lognormal"),
    ],
)
def test_a_field_with_next_to_nothing_in_the_band(distribution, said):
    field = {"cov": 0.1, "correlation_length_m": 1000.0, "distribution": distribution}
    text = faults(profile={"shortest_m": 3.0, "longest_m": 3.1}, spatial_variability=field)
    assert "spatial_variability.cov: received" in text
    assert said in text
    assert "at most 0.0" in text  # what would do


@pytest.mark.usefixtures("fresh_cache")
def test_a_run_with_every_form(tmp_path):
    """Fields, factors, bending and equivalent cycles together, the same whatever the batch."""
    import mcsettle as ms

    study = toy.study(
        profile={"shortest_m": 8.0},
        spatial_variability=FIELD,
        settlement={
            "settlement_factor": toy.FACTOR,
            "cycles": "equivalent",
            "equivalence_exponent": 3.0,
            "equivalence_history": "reference",
            "section_log_sd": 0.2,
        },
        track={"model": "beam", "rail_bending_share": 0.5},
    )
    one = ms.run_study(study, tmp_path / "one")
    two = ms.run_study(study, tmp_path / "two", RunOptions(batch=3))
    assert one.folder != two.folder
    days = [
        read_results(run.folder).realisations["tamping_interval_days"].to_numpy()
        for run in (one, two)
    ]
    assert np.array_equal(*days, equal_nan=True)
    assert np.isfinite(days[0]).all()
