"""Equivalent-linear soil in a study file: keys, defaults, round trip, faults, Step A."""

import copy
import tomllib
from pathlib import Path
from typing import Any

import pytest

from mcsettle import step_a
from mcsettle.curves import Curve
from mcsettle.errors import InputError
from mcsettle.soil import EMBANKMENT_CURVE, GROUND_CURVE, SofteningSettings
from mcsettle.study import Study, resolved_toml
from mcsettle.track import CASE_STUDY_TRACK

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


def test_every_service_has_a_ground_of_its_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("MCSETTLE_CACHE", str(tmp_path))
    asked: list[Any] = []

    def response(*arguments: Any) -> Any:
        asked.append(arguments[4])
        return arguments[4]

    monkeypatch.setattr(step_a, "track_response", response)
    monkeypatch.setattr(step_a, "_transfer", lambda ground, *_: ground)
    made = step_a.step_a(Study.from_mapping(SOUND))
    assert sorted(round(ground.speed * 3.6) for ground in asked) == [201, 225]
    fast, slow = made.transfers["base", "b"]
    assert made.transfers["base", "a"] == (slow,)
    assert round(fast.speed * 3.6) == 225  # type: ignore[attr-defined]
    assert isinstance(fast.settings, SofteningSettings)  # type: ignore[attr-defined]
    asked.clear()
    step_a.step_a(Study.from_mapping(with_track(soil="linear")))
    assert asked == [None]
