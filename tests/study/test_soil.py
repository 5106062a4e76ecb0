"""Equivalent-linear soil in a study file: keys, defaults, round trip, faults, Step A."""

import copy
import tomllib
from pathlib import Path
from typing import Any

import pytest

from mcsettle.errors import InputError
from mcsettle.railway.modulus_curves import Curve
from mcsettle.railway.softening_choices import EMBANKMENT_CURVE, GROUND_CURVE, SofteningSettings
from mcsettle.railway.track import CASE_STUDY_TRACK
from mcsettle.run.factor_digest import factor_warnings, transfer_identity
from mcsettle.step_a import transfers
from mcsettle.study.study import Study, resolved_toml

SOUND: dict[str, Any] = {
    "schema_version": 1,
    "track": {"soil": "equivalent_linear"},
    "profile": {"sd_mm": 1.03},
    "limit": {"sd_limit_mm": 1.5},
    "trains": {"passenger": {"vehicle": "passenger", "cars": 2}},
    "scenarios": [
        {"name": "a", "timetable": [{"train": "passenger", "speed_kmh": 201, "per_day": 72}]},
        {"name": "b", "timetable": [{"train": "passenger", "speed_kmh": 225, "per_day": 72},
                                    {"train": "passenger", "speed_kmh": 201, "per_day": 2}]},
    ],
}  # fmt: skip


def with_track(**keys: Any) -> dict[str, Any]:
    data = copy.deepcopy(SOUND)
    data["track"] |= keys
    return data


def test_defaults_are_ishibashi_and_zhang() -> None:
    study = Study.from_mapping(SOUND)
    softening = study.softening("base")
    assert softening is not None
    curves = softening.layer_curves(CASE_STUDY_TRACK)
    assert curves == (EMBANKMENT_CURVE, EMBANKMENT_CURVE, GROUND_CURVE)
    assert (EMBANKMENT_CURVE.plasticity_index, GROUND_CURVE.plasticity_index) == (0.0, 15.0)
    text = resolved_toml(study)
    for line in ("[track.softening]", "strain_factor = 0.65", 'octahedral = "third"',
                 "tolerance = 0.03", "max_iterations = 10", "keep_last = false",
                 'curve = "ishibashi_zhang"', "plasticity_index = 15.0"):  # fmt: skip
        assert line in text


def test_linear_soil_has_none_of_it() -> None:
    study = Study.from_mapping(with_track(soil="linear"))
    assert study.softening("base") is None
    assert "curve" not in resolved_toml(study)
    assert "softening" not in resolved_toml(study)


def test_curves_by_layer_and_variant_survive_the_round_trip() -> None:
    data = with_track(
        softening={"octahedral": "engineering", "tolerance": 0.01, "keep_last": True},
        layers={
            "ballast": {"curve": "menq", "uniformity_coefficient": 2.5, "d50_mm": 42.0},
            "subgrade": {"curve": "darendeli", "plasticity_index": 20, "ocr": 2},
        },
    )
    data["variants"] = [
        {"name": "one"},
        {"name": "two", "layers": {"subgrade": {"plasticity_index": 30}}},
    ]
    study = Study.from_mapping(data)
    one, two = (study.softening(name) for name in ("one", "two"))
    assert one is not None
    assert two is not None
    assert dict(one.curves)["ballast"].kind == "menq"
    assert dict(one.curves)["ballast"].d50 == pytest.approx(0.042)
    assert dict(one.curves)["subgrade"] == Curve("darendeli", 20.0, 2.0)
    assert dict(two.curves)["subgrade"] == Curve("darendeli", 30.0, 2.0)
    assert (one.octahedral, one.tolerance, one.keep_last) == ("engineering", 0.01, True)
    text = resolved_toml(study)
    again = Study.from_mapping(tomllib.loads(text))
    assert again == study
    assert resolved_toml(again) == text
    assert again.softening("two") == two
    assert again.digest == study.digest != Study.from_mapping(SOUND).digest


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"soil": "linear", "softening": {"tolerance": 0.1}}, "track.softening: has no meaning"),
        (
            {"soil": "linear", "layers": {"subgrade": {"plasticity_index": 9}}},
            "track.layers.subgrade.plasticity_index: has no meaning",
        ),
        ({"model": "beam"}, "with model = 'beam' it is 'linear'"),
        ({"softening": {"octahedral": "tenth"}}, "third, engineering"),
        ({"softening": {"tolerance": 0}}, "received 0"),
        ({"layers": {"subgrade": {"curve": "hardin"}}}, "track.layers.subgrade.curve"),
        ({"layers": {"subgrade": {"plasticity_index": -1}}}, "received -1"),
        ({"soil": "equivalent"}, "did you mean 'equivalent_linear'"),
    ],
)
def test_faults_are_told(keys: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError) as caught:
        Study.from_mapping(with_track(**keys))
    assert told in str(caught.value)


def test_a_variant_may_soften_what_the_study_does_not() -> None:
    data = with_track(soil="linear", softening={"tolerance": 0.01})
    data["variants"] = [{"name": "as_given"}, {"name": "soft", "soil": "equivalent_linear"}]
    study = Study.from_mapping(data)
    assert study.softening("as_given") is None
    soft = study.softening("soft")
    assert soft is not None
    assert soft.tolerance == 0.01
    again = Study.from_mapping(tomllib.loads(resolved_toml(study)))
    assert again == study
    assert again.softening("soft") == soft
    data["track"] |= {"model": "beam"}
    with pytest.raises(InputError, match=r"variants\[2\]\.soil"):
        Study.from_mapping(data)


def factor(**keys: Any) -> dict[str, Any]:
    data = with_track(soil="linear")
    data["settlement"] = {"settlement_factor": 20.0}
    data["variants"] = [{"name": "as_given"}, {"name": "own", "settlement_factor": 1.0},
                        {"name": "soft", "soil": "equivalent_linear"}]  # fmt: skip
    first = Study.from_mapping(data)
    identity = transfer_identity(first.scene("as_given", "a"), first.scenes)
    data["settlement"]["factor_digest"] = identity
    for path, value in keys.items():
        table, key = path.split("__")
        data[table] = {**data.get(table, {}), key: value}
    return data


def test_a_factor_knows_its_transfer_functions() -> None:
    study = Study.from_mapping(factor())
    assert study.variant("own").factor_digest is None  # a factor of its own
    (remark,) = factor_warnings(study)  # the softened ground is another one
    given = study.settlement.factor_digest or ""
    own = transfer_identity(study.scene("soft", "a"), study.scenes)
    for part in ("'soft'", given, own, "mcsettle calibrate STUDY --scenario a --variant soft"):
        assert part in remark
    assert given != own
    again = Study.from_mapping(tomllib.loads(resolved_toml(study)))
    assert factor_warnings(again) == [remark]


@pytest.mark.parametrize(
    ("change", "other"),
    [
        ({"track__hertz_stiffness_n_per_m": 2e9}, True),
        ({"track__layers": {"subgrade": {"youngs_modulus_pa": 6e7}}}, True),
        ({"track__layers": {"subgrade": {"strength_pa": 6e4}}}, False),
        ({"profile__window_m": 400.0}, True),
        ({"profile__sd_mm": 1.2}, False),
        ({"settlement__settlement_factor": 2.0}, False),
    ],
)
def test_what_transfer_functions_depend_on_changes_their_digest(
    change: dict[str, Any], other: bool
) -> None:
    remarks = factor_warnings(Study.from_mapping(factor(**change)))
    assert any("'as_given'" in remark for remark in remarks) == other


@pytest.mark.parametrize(
    ("keys", "named"),
    [
        ({"spatial_variability": {"cov": 0.1, "correlation_length_m": 5.0}}, "spatial_variability"),
        ({"long_run_cycles": 1e6}, "long_run_cycles"),
        ({"stress": "total"}, "stress"),
    ],
)
def test_the_study_s_factor_in_another_model_form(keys: dict[str, Any], named: str) -> None:
    data = factor()
    data["variants"].append({"name": "form", **keys})
    remarks = [r for r in factor_warnings(Study.from_mapping(data)) if "'form'" in r]
    (remark,) = remarks
    for part in ("another model form", named, "--variant form"):
        assert part in remark
    data["variants"][-1]["settlement_factor"] = 3.0
    assert not any("'form'" in r for r in factor_warnings(Study.from_mapping(data)))


def test_a_factor_digest_changes_no_result() -> None:
    without = factor()
    del without["settlement"]["factor_digest"]
    assert Study.from_mapping(without).digest == Study.from_mapping(factor()).digest


def test_a_beam_has_no_moduli_of_layers() -> None:
    data = with_track(model="beam", soil="linear", damping_convention="loss_factor")
    data["track"]["layers"] = {"subgrade": {"youngs_modulus_pa": 6e7, "strength_pa": 1e5}}
    data["track"]["rail"] = {"offset_m": 0.7}
    with pytest.raises(InputError) as caught:
        Study.from_mapping(data)
    for key in ("damping_convention", "rail.offset_m", "layers.subgrade.youngs_modulus_pa"):
        assert f"track.{key}: has no effect" in str(caught.value)
    assert "strength_pa" not in str(caught.value)


def test_every_service_has_a_ground_of_its_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("MCSETTLE_CACHE", str(tmp_path))
    asked: list[Any] = []

    def response(*arguments: Any) -> Any:
        asked.append(arguments[4])
        return arguments[4]

    monkeypatch.setattr(transfers, "track_response", response)
    monkeypatch.setattr(transfers, "cached_transfer", lambda ground, *_: ground)
    made = transfers.step_a(Study.from_mapping(SOUND).scenes)
    assert sorted(round(ground.speed * 3.6) for ground in asked) == [201, 225]
    fast, slow = made.transfers["base", "b"]
    assert made.transfers["base", "a"] == (slow,)
    assert round(fast.speed * 3.6) == 225  # type: ignore[attr-defined]
    assert isinstance(fast.settings, SofteningSettings)  # type: ignore[attr-defined]
    asked.clear()
    transfers.step_a(Study.from_mapping(with_track(soil="linear")).scenes)
    assert asked == [None]
