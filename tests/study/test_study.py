"""Study files: what is accepted, how faults are told, and what a study builds."""

import copy
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import toy
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mcsettle.errors import InputError
from mcsettle.railway.track import (
    CASE_STUDY_TRACK,
    LEAN_CLAY,
    TOY_TRACK,
    VALIDATION_TRACK,
    Material,
    rayleigh_speed,
)
from mcsettle.railway.vehicle import FREIGHT, PASSENGER
from mcsettle.study.read import LARGEST_FILE
from mcsettle.study.schema.study import json_schema
from mcsettle.study.study import Study, load_study, resolved_toml

STUDIES = Path(__file__).resolve().parents[2] / "studies"


def sound() -> dict[str, Any]:
    """A small sound study of the section track, as TOML would give it."""
    return {
        "schema_version": 1,
        "profile": {"sd_mm": 1.03},
        "limit": {"sd_limit_mm": 1.5},
        "economics": {"effect": "speed", "baseline": "slow"},
        "trains": {"passenger": {"vehicle": "passenger", "cars": 11}},
        "scenarios": [
            {
                "name": name,
                "timetable": [{"train": "passenger", "speed_kmh": speed, "per_day": 72}],
            }
            for name, speed in (("slow", 201), ("fast", 225.0))
        ],
    }


def changed(*changes: tuple[str, Any]) -> dict[str, Any]:
    """A sound study with dotted paths set (None: removed); digits index lists."""
    data = sound()
    for path, value in changes:
        *parents, last = path.split(".")
        here: Any = data
        for step in parents:
            here = here[int(step)] if isinstance(here, list) else here.setdefault(step, {})
        key = int(last) if isinstance(here, list) else last
        if value is None:
            del here[key]
        else:
            here[key] = value
    return data


def refusal(data: Any) -> str:
    """The message with which a study is refused."""
    with pytest.raises(InputError) as caught:
        Study.from_mapping(data, "study.toml")
    return str(caught.value)


# --- faults ---------------------------------------------------------------------------------------

INF, NAN = float("inf"), float("nan")
FAULTS = [
    # (path, value, what the message must say)
    ("sed", 1, ["sed: is not a key here", "did you mean 'seed'?"]),
    ("limit.sd_limit_m", 1.5, ["limit.sd_limit_m:", "did you mean 'sd_limit_mm'?"]),
    ("trains.passenger.axleload_t", 17, ["did you mean 'axle_load_t'?"]),
    ("scenarios.0.timetable.0.speed", 17, ["[1].timetable[1].speed:", "'speed_kmh'"]),
    ("track.layers.subgrade.youngs_modulus_pa", "70 mm", ["'70 mm'", "'mm', which is no Pa"]),
    ("track.layers.subgrade.youngs_modulus_pa", "70", ["has no unit", "'70 Pa'"]),
    ("track.layers.subgrade.youngs_modulus_pa", "70 MPascals!", ["cannot be read"]),
    ("track.layers.subgrade.youngs_modulus_pa", "70 wibble", ["unknown"]),
    ("track.layers.subgrade.youngs_modulus_pa", "stiff", ["is not a number in Pa"]),
    ("track.layers.ballast.height_m", -0.3, ["track.layers.ballast.height_m", "-0.3", "greater"]),
    ("track.layers.ballast.height_m", 0, ["received 0", "greater than 0"]),
    ("track.layers.balast.height_m", 0.3, ["did you mean 'ballast'?"]),
    ("track.layers.subgrade.height_m", 5.0, ["half-space", "height_m"]),
    ("track.layers.ballast.settlement_a", 0.5, ["'ballast' has no settlement_a"]),
    ("track.layers.ballast.width_m", 9.0, ["at least as wide"]),
    ("track.sleeper.width_m", 0.7, ["exceeds their spacing"]),
    ("track.support.loss_factor", 0.1, ["no meaning with model = 'section'"]),
    ("track.preset", "beam", ["'case_study' or 'validation'"]),
    ("track.soil", "nonlinear", ["'nonlinear'", "'linear'"]),
    ("limit.sd_limit_mm", 1.03, ["limit.sd_limit_mm", "received 1.03", "profile.sd_mm = 1.03"]),
    ("limit.sd_limit_mm", NAN, ["received nan", "finite"]),
    ("limit.sd_limit_mm", INF, ["received inf"]),
    ("limit.sd_limit_mm", True, ["received True", "number"]),
    ("limit.horizon_years", 0, ["received 0", "greater than 0"]),
    ("profile.window_m", 60, ["received 60", "70"]),
    ("profile.longest_m", 150, ["window_m", "twice"]),
    ("profile.shortest_m", 40, ["profile.longest_m", "exceed shortest_m = 40"]),
    ("profile.fra_class", 7, ["received 7", "6"]),
    ("run.realisations", 0, ["run.realisations", "received 0", "1"]),
    ("run.realisations", 10.5, ["received 10.5", "integer"]),
    ("run.realisations", "many", ["received 'many'; it must be an integer"]),
    ("run.history_days", [1.0, NAN], ["run.history_days[2]", "nan"]),
    ("seed", -1, ["received -1"]),
    ("scenarios", [], ["scenarios: is empty"]),
    ("scenarios.0.timetable", [], ["scenarios[1].timetable: is empty"]),
    ("scenarios.0.timetable.0.per_day", 0, ["received 0"]),
    ("scenarios.0.timetable.0.train", "pasenger", ["no train here", "did you mean 'passenger'?"]),
    ("scenarios.0.timetable.0.speed_kmh", 400, ["Rayleigh speed 393 km/h", "allow_supercritical"]),
    ("scenarios.0.name", "FAST", ["scenarios[2].name", "differs from 'FAST' in capitals alone"]),
    ("scenarios.0.name", "fast", ["scenarios[1].name", "scenarios[2].name", "more than once"]),
    ("scenarios.0.name", "a/b", ["letters, digits"]),
    ("economics.baseline", "slo", ["economics.baseline", "did you mean 'slow'?"]),
    ("economics.effect", "tonnage", ["same tonnage as the baseline"]),
    ("scenarios.1.timetable.0.speed_kmh", 201, ["same speed as the baseline"]),
    ("trains", {}, ["trains: is empty"]),
    ("trains.passenger.vehicle", "frieght", ["did you mean 'freight'?"]),
    ("trains.passenger.cars", 0, ["received 0"]),
    ("trains.passenger.car_length_m", 20, ["trains.passenger: ", "length 20"]),
    ("trains.passenger.axle_spacing_m", 19.5, ["less than the bogie spacing"]),
    ("variants", [{"name": "x"}, {"name": "x"}], ["variants[1].name"]),
    ("variants", [{"name": "x", "layers": {"clay": {}}}], ["variants[1].layers.clay"]),
    ("variants", [{"name": "x", "stress": "both"}], ["traffic, total"]),
    ("calibration", {"scenario": "x", "target_days": 9, "factor": 2}, ["calibration.scenario"]),
    ("schema_version", 2, ["received 2"]),
    ("limit", None, ["limit: is missing"]),
    ("title", 3, ["title", "received 3"]),
]


@pytest.mark.parametrize(("path", "value", "told"), FAULTS, ids=[f"{f[0]}={f[1]}" for f in FAULTS])
def test_fault_is_told_with_path_value_and_remedy(path: str, value: Any, told: list[str]) -> None:
    message = refusal(changed((path, value)))
    for part in told:
        assert part in message


def test_freight_has_no_wheelset_model_and_no_primary_suspension() -> None:
    freight = {"vehicle": "freight", "cars": 1}
    assert "choose the model 'bogies'" in refusal(
        changed(("trains.f", freight | {"model": "wheelsets"}))
    )
    assert "has no primary_stiffness_n_per_m" in refusal(
        changed(("trains.f", freight | {"primary_stiffness_n_per_m": 1e6}))
    )


def test_all_faults_are_told_at_once() -> None:
    """Faults inside tables and between sound tables stand in one message, each once."""
    message = refusal(
        changed(
            ("sed", 1),
            ("run.realisations", 0),
            ("profile.sd_mm", 2.0),
            ("economics.baseline", "none"),
            ("trains.other", {"vehicle": "tram", "cars": 1}),
            ("scenarios.1.timetable.0.speed_kmh", 500),
        )
    )
    assert "6 faults" in message
    assert len(message.splitlines()) == 7
    for path in ("sed", "run.realisations", "limit.sd_limit_mm", "economics.baseline"):
        assert f"  {path}: " in message


def test_a_faulty_scenario_is_not_also_called_unknown() -> None:
    message = refusal(changed(("scenarios.0.timetable", [])))
    assert "1 fault" in message


def test_a_list_with_a_faulty_entry_is_not_also_called_empty() -> None:
    message = refusal(
        changed(("scenarios.0.timetable.0.speed_kmh", "fast"), ("scenarios.1.timetable", []))
    )
    assert "2 faults" in message
    assert "scenarios[1].timetable: is empty" not in message
    assert "scenarios[2].timetable: is empty" in message


def test_message_fits_one_screen() -> None:
    message = refusal(changed(*((f"key{i}", i) for i in range(100))))
    assert len(message.splitlines()) <= 24
    assert "80 more" in message
    assert max(map(len, refusal(changed(("title", ["x" * 9999]))).splitlines())) < 310


# --- files ----------------------------------------------------------------------------------------


def test_a_byte_order_mark_and_line_ends_change_nothing(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "studies" / "toy.toml").read_text(encoding="utf-8")
    digests = set()
    for name, data in {
        "plain": text.encode(),
        "mark": text.encode("utf-8-sig"),
        "lines": text.replace("\n", "\r\n").encode(),
    }.items():
        (tmp_path / f"{name}.toml").write_bytes(data)
        digests.add(load_study(tmp_path / f"{name}.toml").digest)
    (tmp_path / "shared.toml").write_bytes(b"\xef\xbb\xbf[vehicles.a]\nlike = 'passenger'\n")
    (tmp_path / "includes.toml").write_text("include = ['shared.toml']\n" + text, encoding="utf-8")
    assert len(digests) == 1
    assert "a" in load_study(tmp_path / "includes.toml").vehicle_tables
    (tmp_path / "wide.toml").write_bytes(text.encode("utf-16"))
    with pytest.raises(InputError, match="not UTF-8 but UTF-16 text: save it as UTF-8"):
        load_study(tmp_path / "wide.toml")


@pytest.mark.parametrize(("rate", "value"), [(0, 0.0), (0.0, 0.0), ("3.5 %", 0.035), ("0 %", 0.0)])
def test_a_discount_rate_is_a_share_or_per_cent_and_may_be_nothing(rate, value) -> None:
    study = toy.study(economics={"effect": "speed", "baseline": "v201", "discount_rate": rate})
    assert study.economics.discount_rate == value


@pytest.mark.parametrize(
    ("rate", "said"),
    [
        (3.5, "is 350 %: write 0.035, or '3.5 %'"),
        ("3.5", "neither a number nor"),
        (-0.1, "greater"),
    ],
)
def test_a_discount_rate_that_cannot_be(rate, said) -> None:
    with pytest.raises(InputError, match=said):
        toy.study(economics={"effect": "speed", "baseline": "v201", "discount_rate": rate})


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"a = ", "not valid TOML"),
        (b"\xff\xfe", "not UTF-8"),
        (b"a = " + b"[" * 20_000, "nested too deeply"),
        (b"#" * (LARGEST_FILE + 1), "bytes"),
        (b"a = 1" + b"0" * 5000, "not valid TOML"),
        (b"", "schema_version: is missing"),
    ],
    ids=["syntax", "encoding", "depth", "size", "huge integer", "empty"],
)
def test_unusable_file(tmp_path: Path, content: bytes, told: str) -> None:
    path = tmp_path / "study.toml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=told):
        load_study(path)


def test_missing_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        load_study(tmp_path / "none.toml")
    with pytest.raises(InputError, match="is a folder"):
        load_study(tmp_path)
    with pytest.raises(InputError, match="cannot be read"):
        load_study("a\0b")


# --- meaning --------------------------------------------------------------------------------------


def test_units_are_converted() -> None:
    study = Study.from_mapping(
        changed(
            ("track.layers.subgrade.youngs_modulus_pa", "50 MPa"),
            ("track.layers.ballast.height_m", "35 cm"),
            ("trains.passenger.secondary_damping_ns_per_m", "40 kN*s/m"),
            ("scenarios.0.timetable.0.speed_kmh", "55 m/s"),
            ("limit.sd_limit_mm", "0.0015 m"),
        )
    )
    layers = {layer.name: layer for layer in study.track().layers}
    assert layers["subgrade"].material.youngs_modulus == pytest.approx(50e6, rel=1e-12)
    assert layers["ballast"].height == pytest.approx(0.35, rel=1e-12)
    assert study.trains["passenger"].cars[0].secondary.damping == pytest.approx(40e3, rel=1e-12)
    assert study.timetable("slow").services[0].speed == pytest.approx(55.0, rel=1e-12)
    assert study.limit.sd_limit == pytest.approx(1.5e-3, rel=1e-12)


def test_presets_are_the_papers() -> None:
    data = changed(("trains.freight", {"vehicle": "freight", "cars": 40}))
    study = Study.from_mapping(data)
    assert study.track() == CASE_STUDY_TRACK
    assert study.trains["passenger"].cars == (PASSENGER,) * 11
    assert study.trains["freight"].cars == (FREIGHT,) * 40
    assert study.trains["freight"].mass == 4000e3  # Table 5: 0.004 MGT a train
    validation = changed(("track.preset", "validation"))
    assert Study.from_mapping(validation).track() == VALIDATION_TRACK
    assert Study.from_mapping(changed(("track.model", "beam"))).track() == TOY_TRACK


def test_variants_override_settlement_and_layers() -> None:
    study = Study.from_mapping(
        changed(
            ("settlement", {"settlement_factor": 30.0, "cycles": "per_vehicle"}),
            (
                "variants",
                [
                    {"name": "base"},
                    {"name": "total", "stress": "total", "settlement_factor": 1.0},
                    {"name": "k04", "layers": {"subgrade": {"k0": 0.4}}},
                ],
            ),
        )
    )
    base, total = study.settlement_settings("base"), study.settlement_settings("total")
    assert (base.stress, base.settlement_factor, base.cycles) == ("traffic", 30.0, "per_vehicle")
    assert (total.stress, total.settlement_factor, total.cycles) == ("total", 1.0, "per_vehicle")
    assert study.track("base").layers[-1].k0 == 0.5
    assert study.track("k04").layers[-1].k0 == 0.4
    assert study.track("k04").layers[:-1] == study.track("base").layers[:-1]
    model = study.scene("base", study.scenario_names[0]).settlement
    assert model.laws == tuple(layer.law for layer in CASE_STUDY_TRACK.layers)
    with pytest.raises(InputError, match="did you mean 'total'"):
        study.settlement_settings("totl")
    with pytest.raises(InputError, match="no scenario"):
        study.timetable("x")


def test_economics_default_to_the_timetable() -> None:
    """72 trains of 748 t: 26.28 thousand trains a year, 0.053856 MGT a day (Table 5: 0.054)."""
    study = Study.from_mapping(sound())
    assert study.economics is not None
    assert study.economics.base_speed_kmh == 201.0
    assert study.economics.trains_thousand_per_year == pytest.approx(26.28, rel=1e-12)
    assert study.economics.mgt_per_day == pytest.approx(0.053856, rel=1e-12)
    change = study.change("fast")
    assert study.change("slow") is None
    assert change is not None
    assert (change.base, change.changed) == (201.0, 225.0)
    assert change.divisor == pytest.approx(225 * 26.28, rel=1e-12)


def test_supercritical_speed_needs_permission_and_softer_layers_warn() -> None:
    fast = ("scenarios.1.timetable.0.speed_kmh", 400)
    study = Study.from_mapping(changed(fast, ("track.allow_supercritical", True)))
    assert "is above the Rayleigh speed of 'subgrade'" in study.warnings[0]
    assert Study.from_mapping(sound()).warnings == ()
    near = Study.from_mapping(changed(("scenarios.1.timetable.0.speed_kmh", 330)))
    assert len(near.warnings) == 1
    assert "above 80% of the Rayleigh speed of 'subgrade' (393 km/h)" in near.warnings[0]
    # Appendix B: the upper 0.5 m of 30 MPa carry Rayleigh waves at 254 km/h, below them 414 km/h.
    soft = changed(("track.preset", "validation"), ("scenarios.1.timetable.0.speed_kmh", 260))
    warnings = Study.from_mapping(soft).warnings
    assert [("'subgrade_1'" in w) for w in warnings] == [True]
    assert "is above the Rayleigh speed" in warnings[0]


@pytest.mark.parametrize(
    ("poisson", "ratio"),
    # c_R/c_S: 0.9553 for ν = 0.5 (Rayleigh 1885), √(2 − 2/√3) for ν = 1/4, 0.8740 for ν = 0.
    [(0.4999999, 0.95531), (0.25, (2.0 - 2.0 / 3.0**0.5) ** 0.5), (0.0, 0.874032)],
)
def test_rayleigh_speed_of_known_solids(poisson: float, ratio: float) -> None:
    material = Material(1e8, poisson, 2000.0, 0.0)
    # The literature ratios are quoted to five digits.
    assert rayleigh_speed(material) / material.shear_wave_speed == pytest.approx(ratio, abs=1e-5)


def test_lean_clay_rayleigh_speed_is_below_its_shear_wave() -> None:
    assert 0.93 < rayleigh_speed(LEAN_CLAY.material) / LEAN_CLAY.material.shear_wave_speed < 0.94


# --- round trip, digest, schema -------------------------------------------------------------------


@pytest.mark.parametrize("path", sorted(STUDIES.glob("*.toml")), ids=lambda p: p.stem)
def test_resolved_study_reads_back_equal(path: Path) -> None:
    study = load_study(path)
    text = resolved_toml(study)
    again = Study.from_mapping(tomllib.loads(text), folder=path.parent)
    assert again == study
    assert again.digest == study.digest
    assert resolved_toml(again) == text
    for variant in study.variant_names:
        assert again.track(variant) == study.track(variant)
    assert again.trains == study.trains


def test_resolved_study_names_every_default() -> None:
    text = resolved_toml(Study.from_mapping(sound()))
    for line in (
        "youngs_modulus_pa = 70000000.0",
        "axle_load_t = 17.0",
        "car_length_m = 25.9",
        "integration_depth_m = 5.5",
        "k0 = 0.5",
        "horizon_years = 50.0",
        'cycles = "shared"',
        "spacing_m = 0.65",
    ):
        assert line in text


def test_odd_texts_survive_the_round_trip() -> None:
    title = 'say "no"\\ \t\n\x00\x7f\x85 é 𝄞 \u2028'
    study = Study.from_mapping(changed(("title", title)))
    assert Study.from_mapping(tomllib.loads(resolved_toml(study))).title == title


def test_digest_is_of_what_decides_results() -> None:
    digest = Study.from_mapping(sound()).digest
    same = changed(
        ("title", "x"),
        ("run.realisations", 7),
        ("scenarios.0.title", "x"),
        ("settlement", {"cycles_per_passage": 1}),  # a default, written out
        ("trains.passenger.axle_load_t", "17000 kg"),
    )
    assert Study.from_mapping(same).digest == digest
    others = [
        ("seed", 2),
        ("profile.sd_mm", 1.04),
        ("run.stepping", "every_axle"),
        ("track.layers.subgrade.k0", 0.51),
        ("trains.passenger.secondary_damping_ns_per_m", 35e3),
        ("scenarios.0.timetable.0.per_day", 71),
    ]
    digests = {Study.from_mapping(changed(other)).digest for other in others}
    assert len(digests | {digest}) == len(others) + 1


def test_with_run_changes_what_it_is_asked_for() -> None:
    study = Study.from_mapping(sound())
    other = study.with_run(realisations=3, seed=9, stepping="every_axle")
    assert (other.run.realisations, other.seed, other.run.stepping) == (3, 9, "every_axle")
    assert other.track_table == study.track_table
    assert study.with_run() == study
    with pytest.raises(InputError, match=r"run\.realisations"):
        study.with_run(realisations=0)


def test_schema_names_every_key() -> None:
    schema = json_schema()
    assert set(sound()) <= set(schema["properties"])
    assert schema["additionalProperties"] is False
    layer = schema["$defs"]["LayerTable"]["properties"]
    text = str(layer["youngs_modulus_pa"])
    assert "'number'" in text
    assert "'string'" in text


# --- the paper's studies --------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["linespeed", "traffic"])
def test_published_days_give_published_elasticities_and_costs(name: str) -> None:
    """Tables 7 and 8 from Tables 3 and 6, to every printed digit, by the studies' own settings."""
    import numpy as np

    from mcsettle.economics import paired_effects

    study = load_study(STUDIES / f"{name}.toml")
    assert study.economics is not None
    published = {(row.metric, row.scenario): row.value for row in study.reference}
    days = {s: published["tamping_interval_days", s] for s in study.scenario_names}
    compared = 0
    for scenario in study.scenario_names:
        change = study.change(scenario)
        if change is None:
            continue
        effects = paired_effects(
            np.array([days[study.economics.baseline]]),
            np.array([days[scenario]]),
            np.array([np.nan]),
            np.array([np.nan]),
            change,
            study.economics.tamping_cost_per_track_km,
            study.economics.discount_rate,
        )
        assert round(float(effects.elasticity[0]), 2) == published["elasticity", scenario]
        assert round(float(effects.marginal_cost[0]), 3) == published["marginal_cost", scenario]
        compared += 1
    assert compared == 3


def test_traffic_study_has_the_tonnages_of_table_5() -> None:
    study = load_study(STUDIES / "traffic.toml")
    per_year = [study.mgt_per_year(name) for name in "ABCD"]
    assert per_year == [19.58, 19.5875, 21.04, 22.50]
    # The trains' own sums agree with the printed days to their three or four digits.
    for name in "ABCD":
        own = study.timetable(name).mass_per_day / 1e9
        assert own == pytest.approx(study.mgt_per_day(name), rel=3e-3)


# --- mutations ------------------------------------------------------------------------------------

SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.integers(min_value=10**300, max_value=10**400),
    st.floats(),
    st.text(max_size=12),
    st.sampled_from(["70 MPa", "-3 m", "9**9**9 m", "1e400 Pa", "2 m**4**4**4**4", "5 mph", "1 %"]),
    st.dates(),
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3)
    ),
    max_leaves=5,
)


def paths(value: Any, here: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every place in nested mappings and lists."""
    found = [here] if here else []
    if isinstance(value, dict):
        items: Any = value.items()
    else:
        items = enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        found += paths(inner, (*here, key))
    return found


FULL = {
    name: tomllib.loads(resolved_toml(load_study(STUDIES / f"{name}.toml")))
    for name in ("toy", "traffic")
}
for _full in FULL.values():
    del _full["stated"]
PLACES = {name: paths(full) for name, full in FULL.items()}
KNOWN_KEYS = sorted({s for places in PLACES.values() for p in places for s in map(str, p)})


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_mutated_studies_are_read_or_refused_and_never_crash(data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(sorted(FULL)))
    study = copy.deepcopy(FULL[name])
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.sampled_from(PLACES[name]))
        here: Any = study
        try:
            for step in place[:-1]:
                here = here[step]
            action = data.draw(st.sampled_from(["set", "delete", "add"]))
            if action == "set":
                here[place[-1]] = data.draw(VALUES)
            elif action == "delete":
                del here[place[-1]]
            elif isinstance(here, dict):
                key = data.draw(st.sampled_from(KNOWN_KEYS) | st.text(max_size=8))
                here[key] = data.draw(VALUES)
        except (KeyError, IndexError, TypeError):
            continue  # an earlier mutation took the place away
    try:
        read = Study.from_mapping(study)
    except InputError:
        return
    assert Study.from_mapping(tomllib.loads(resolved_toml(read))) == read


@settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(content=st.binary(max_size=200) | st.text(max_size=200).map(str.encode))
def test_any_file_is_refused_in_words(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "study.toml"
    path.write_bytes(content)
    with pytest.raises(InputError):
        load_study(path)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ((("run.stepping", "every_axle"), ("profile.window_m", 400.0)), "take 'cycle_jump'"),
        ((("run.precision", "f32"),), "takes stepping 'every_axle'"),
        (
            (("run.stepping", "every_train"), ("run.right_hand_side", "pointwise")),
            "right_hand_side = 'pointwise' takes 'every_axle'",
        ),
    ],
)
def test_what_the_models_do_not_cover_is_refused_before_any_work(changes, words) -> None:
    assert words in refusal(changed(*changes))


def test_variants_cross_model_forms() -> None:
    """Stress, cycles, spectrum, damping and curves: each reaches the model of its own variant alone."""
    curve = {"subgrade": {"curve": "darendeli"}}
    variants = [
        {"name": "plain"},
        {"name": "total", "stress": "total"},
        {"name": "counts", "cycles": "per_vehicle"},
        {"name": "loss", "damping_convention": "loss_factor"},
        {"name": "corner", "spectrum": "fra_one_corner", "fra_class": 5},
        {"name": "soft", "soil": "equivalent_linear", "layers": curve},
    ]
    study = Study.from_mapping(sound() | {"track": {"model": "section"}, "variants": variants})
    assert study.settlement_settings("total").stress == "total"
    assert study.settlement_settings("counts").cycles == "per_vehicle"
    assert study.settlement_settings("plain").stress == "traffic"
    assert study.track("loss").damping_convention == "loss_factor"
    assert study.track("plain").damping_convention == "damping_ratio"
    assert dict(study.softening("soft").curves)["subgrade"].kind == "darendeli"
    assert study.softening("plain") is None
    plain, corner = (study.initial_profiles(name).sample(range(2)) for name in ("plain", "corner"))
    assert not np.allclose(plain, corner)
    np.testing.assert_allclose(np.angle(plain), np.angle(corner))  # the same random numbers
    keys = {study.step_b_key(name, study.scenario_names[0]) for name in study.variant_names}
    assert len(keys) == len(variants)


@pytest.mark.parametrize(
    ("change", "path"),
    [
        (
            {
                "track": {"model": "beam"},
                "variants": [{"name": "x", "damping_convention": "loss_factor"}],
            },
            "variants[1].damping_convention",
        ),
    ],
)
def test_model_forms_without_meaning_are_refused(change, path) -> None:
    with pytest.raises(InputError, match=re.escape(path)):
        Study.from_mapping(sound() | change)


def test_a_misspelt_table_is_not_missing_too(toy_path: Path, tmp_path: Path) -> None:
    text = toy_path.read_text(encoding="utf-8")
    path = tmp_path / "study.toml"
    path.write_text(
        text.replace("[limit]", "[limits]").replace("[[scenarios]]", "[[scenario]]"), "utf-8"
    )
    with pytest.raises(InputError) as refused:
        load_study(path)
    assert str(refused.value).splitlines()[1:] == [
        "  limits: is not a key here; did you mean 'limit'?",
        "  scenario: is not a key here; did you mean 'scenarios'?",
    ]


def test_a_maintenance_without_prices_is_refused(toy_path: Path) -> None:
    data = tomllib.loads(toy_path.read_text(encoding="utf-8"))
    data["maintenance"] = {"recovery": "perfect"}
    Study.from_mapping(data)
    del data["economics"]
    with pytest.raises(InputError, match=r"maintenance: has no meaning without \[economics\]"):
        Study.from_mapping(data)
