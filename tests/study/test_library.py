"""Own and shipped vehicles, trains and tracks: sources, consists, includes, grounds, pads."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import toy

from mcsettle.errors import InputError
from mcsettle.railway.irregularity import wavenumbers
from mcsettle.railway.vehicle import FREIGHT, PASSENGER, natural_frequencies
from mcsettle.step_a.fem25d import MeshSettings
from mcsettle.step_a.fem25d.pml import Border
from mcsettle.step_a.fem25d.solve import outputs, solve
from mcsettle.step_a.fem25d.track_section import track_section
from mcsettle.step_a.interaction import precompute, transfer_digest
from mcsettle.study.build_trains import shipped_library, shipped_vehicles, vehicle_named
from mcsettle.study.study import Study, resolved_toml, study_from_text

DATA = tomllib.loads(
    (Path(__file__).resolve().parents[2] / "studies" / "toy.toml").read_text(encoding="utf-8")
)


def study(folder: Path | None = None, **changes: Any) -> Study:
    data = {k: v for k, v in DATA.items() if k not in ("calibration", "economics", "reference")}
    return Study.from_mapping(data | changes, folder=folder)


def trains(**tables: Any) -> dict[str, Any]:
    timetable = [{"train": name, "speed_kmh": 100.0, "per_day": 2} for name in tables]
    return {"trains": tables, "scenarios": [{"name": "s", "timetable": timetable}]}


@pytest.mark.parametrize("name", shipped_vehicles())
def test_shipped_vehicles_have_sources_and_loads_that_are_their_masses(name: str) -> None:
    table, car = shipped_vehicles()[name], vehicle_named(name, {})
    assert len(table.source) > 40
    assert car.name == name
    mass = car.body_mass + 2.0 * car.bogie_mass + 4.0 * car.wheelset_mass
    assert car.axle_load == pytest.approx(mass / 4.0, rel=0.01)
    body, *_ = natural_frequencies(car)  # of the body on its springs
    assert 0.5 < body < 2.0


@pytest.mark.parametrize("name", shipped_library()["trains"])
def test_shipped_trains_run(name: str) -> None:
    own = study(**trains(x={"library": name}))
    train = own.trains["x"]
    assert train.n_axles == 4 * len(train.cars)
    assert own.train_tables["x"].library is None
    assert Study.from_mapping(tomllib.loads(resolved_toml(own))) == own


def test_the_papers_trains_are_shipped_by_name() -> None:
    own = study(**trains(p={"library": "paper_passenger"}, f={"library": "paper_freight"}))
    assert own.trains["p"].cars == (PASSENGER,) * 11
    assert own.trains["f"].mass == pytest.approx(4000e3)
    shorter = study(**trains(p={"library": "paper_passenger", "cars": 3}))
    assert len(shorter.trains["p"].cars) == 3


def test_a_consist_of_locomotive_loaded_and_empty_wagons() -> None:
    consist = [
        {"vehicle": "power_car"},
        {"vehicle": "freight", "count": 3},
        {"vehicle": "freight", "count": 2, "axle_load_t": 5.5, "body_mass_kg": 8400},
        {"vehicle": "freight", "axle_loads_t": [20, 20, 24, 24]},
    ]
    own = study(**trains(mixed={"consist": consist}))
    train = own.trains["mixed"]
    assert len(train.cars) == 7
    loads = train.axle_forces / 9.81 / 1e3
    np.testing.assert_allclose(loads[:4], 19.49995)
    np.testing.assert_allclose(loads[4:24], [25.0] * 12 + [5.5] * 8)
    np.testing.assert_allclose(loads[24:], [20, 20, 24, 24])
    assert train.mass / 1e3 == pytest.approx(loads.sum())
    assert train.cars[4].body_mass == 8400
    gap = train.axle_positions[3] - train.axle_positions[4]  # power car 21 m, wagon 13.9 m
    assert gap == pytest.approx((21.0 - 11.46 - 3.0) / 2 + (13.9 - 9.7 - 1.7) / 2)
    assert Study.from_mapping(tomllib.loads(resolved_toml(own))) == own
    # Weights only: the dynamic response of unequal axle loads is that of equal ones.
    modes = wavenumbers(200.0, 10.0)
    even = precompute(toy.Train("x", (FREIGHT,)), 27.0, toy.response(), modes)
    uneven = precompute(toy.Train("x", (train.cars[6],)), 27.0, toy.response(), modes)
    np.testing.assert_allclose(uneven.dynamic, even.dynamic, rtol=1e-12)
    assert uneven.digest != even.digest
    assert uneven.rail_deflection[3] > uneven.rail_deflection[0]


def test_a_field_that_a_car_does_not_use_leaves_its_digest_alone() -> None:
    """Transfer functions kept on disk for ordinary trains stay good: SHA-256 of this description."""
    import hashlib
    import json
    from dataclasses import asdict

    train = toy.Train("x", (PASSENGER,))
    described = asdict(train)
    for car in described["cars"]:
        assert car.pop("axle_loads") is None
        assert (car.pop("axles_per_bogie"), car.pop("bodies")) == (2, 1)
    whole = {"train": described, "speed": 50.0, "wavenumbers": [1.0], "hertz_stiffness": 1e9,
             "response": "r"}  # fmt: skip
    expected = hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()
    assert transfer_digest(train, 50.0, np.array([1.0]), 1e9, "r") == expected


def test_own_vehicles_like_others_or_in_full() -> None:
    vehicles = {
        "heavy": {"like": "passenger", "axle_load_t": 19.0},
        "heavier": {"like": "heavy", "bogie_mass_kg": 6000},
        "own": {
            "car_length_m": 12.0, "bogie_spacing_m": 8.0, "axle_spacing_m": 1.8,
            "axle_load_t": 20.0, "body_mass_kg": 70e3, "body_inertia_kg_m2": 8e5,
            "bogie_mass_kg": 3000, "bogie_inertia_kg_m2": 2000, "wheelset_mass_kg": 1500,
            "secondary_stiffness_n_per_m": 3e6, "secondary_damping_ns_per_m": 1e4,
        },
    }  # fmt: skip
    tables = trains(a={"vehicle": "heavier", "cars": 2}, b={"vehicle": "own", "cars": 3})
    own = study(vehicles=vehicles, **tables)
    assert own.trains["a"].cars[0].axle_load == 19e3
    assert own.trains["a"].cars[0].bogie_mass == 6000
    assert own.trains["b"].cars[0].primary is None
    assert Study.from_mapping(tomllib.loads(resolved_toml(own))) == own


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (trains(a={"vehicle": "pasenger", "cars": 2}), "did you mean 'passenger'"),
        (trains(a={"vehicle": "passenger"}), "needs vehicle and cars, or a consist"),
        (trains(a={"cars": 3, "consist": [{"vehicle": "freight"}]}), "has a consist: say"),
        (
            trains(a={"consist": [{"vehicle": "freight", "axle_load_t": 5, "axle_loads_t": [5] * 4}]}),
            "not both",
        ),
        (trains(a={"consist": [{"vehicle": "freight", "axle_loads_t": [5, 5]}]}), "axle_loads_t"),
        (trains(a={"library": "velaro_9"}), "did you mean 'velaro_8'"),
        ({"vehicles": {"a": {"like": "b"}, "b": {"like": "a"}}}, "is like itself"),
        ({"vehicles": {"a": {"body_mass_kg": 1.0}}}, r"vehicle 'a' needs .*car_length_m"),
        ({"vehicles": {"a": {"like": "freight", "primary_damping_ns_per_m": 1}}}, "has no primary"),
        ({"track": {"model": "beam", "library": "mine"}}, "track.library: received 'mine'"),
        ({"include": ["none.toml"]}, r"include\[1\]: .*does not exist"),
        ({"include": ["../x.toml"]}, r"include\[1\]: .*leads out of the study's folder"),
        ({"include": [3]}, r"include\[1\]: is no file name"),
        ({"include": "a.toml"}, "include"),
        (
            {"track": {"model": "beam", "under_sleeper_pad": {"bedding_modulus_n_per_m3": 1e8}}},
            "track.under_sleeper_pad: has no meaning with model = 'beam'",
        ),
        (
            {"track": {"model": "beam", "ground": [{"name": "sand"}]}},
            "ground layer 'sand' needs youngs_modulus_pa, poisson",
        ),
    ],
)  # fmt: skip
def test_faults_are_named(changes: dict[str, Any], said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said):
        study(tmp_path, **changes)


LIBRARY = """
[vehicles.mine]
like = "freight"
axle_load_t = 22.5
source = "weighed"

[trains.ore]
consist = [{ vehicle = "power_car" }, { vehicle = "mine", count = 2 }]

[tracks.soft]
model = "beam"
layers.subgrade.settlement_a = 1.2
support.stiffness_n_per_m2 = 60e6
"""


def test_files_beside_the_study_are_written_into_it(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(LIBRARY, encoding="utf-8")
    track = {"library": "soft", "support": {"loss_factor": 0.1}}
    own = study(tmp_path, include=["mine.toml"], track=track, **trains(x={"library": "ore"}))
    assert own.trains["x"].cars[2].axle_load == 22.5e3
    assert own.track().support_stiffness == 60e6  # type: ignore[union-attr]
    assert own.track().support_damping == 0.1  # type: ignore[union-attr]
    again = Study.from_mapping(tomllib.loads(resolved_toml(own)))  # stands alone
    assert again == own
    assert again.digest == own.digest
    (tmp_path / "mine.toml").write_text(LIBRARY + "\n[limit]\nsd_limit_mm = 9\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"include\[1\]: holds 'limit'"):
        study(tmp_path, include=["mine.toml"])
    (tmp_path / "two.toml").write_text("[trains.ore]\ncars = 1\n", encoding="utf-8")
    (tmp_path / "mine.toml").write_text(LIBRARY, encoding="utf-8")
    with pytest.raises(InputError, match=r"include\[2\]: gives trains.ore a second time"):
        study(tmp_path, include=["mine.toml", "two.toml"])


GROUND = [
    {"name": "fill", "height_m": 2.0, "youngs_modulus_pa": "100 MPa", "poisson": 0.3,
     "density_kg_per_m3": 1900.0, "damping": 0.03, "settlement_a": 0.64, "settlement_b": 0.1,
     "settlement_m": 1.7, "strength_pa": "150 kPa"},
    {"name": "rock", "youngs_modulus_pa": 1e9, "poisson": 0.25, "density_kg_per_m3": 2200.0,
     "damping": 0.01},
]  # fmt: skip


def test_a_ground_in_full_replaces_the_presets() -> None:
    track = {"model": "section", "ground": GROUND, "layers": {"ballast": {"height_m": 0.35}}}
    own = study(track=track)
    built = own.track()
    assert [layer.name for layer in built.layers] == ["ballast", "sub_ballast", "fill", "rock"]
    assert built.layers[3].law is None
    assert built.layers[2].law.strength == 150e3  # type: ignore[union-attr]
    assert built.layers[0].height == 0.35
    assert set(own.track_table.layers) == {"ballast", "sub_ballast"}
    assert Study.from_mapping(tomllib.loads(resolved_toml(own))) == own
    # An input of a ground layer can be uncertain, by the layer's name.
    uncertain = [
        {"input": "track.ground.fill.youngs_modulus_pa", "distribution": "uniform",
         "low": 5e7, "high": 2e8}
    ]  # fmt: skip
    from mcsettle.study.parameter_sets import all_sets

    moduli = {
        member.study.track().layers[2].material.youngs_modulus
        for member in all_sets(study(track=track, uncertain=uncertain, run={"parameter_sets": 4}))
    }
    assert len(moduli) == 4
    with pytest.raises(InputError, match=r"track.layers.subgrade: is no layer"):
        study(track={"ground": GROUND, "layers": {"subgrade": {"height_m": 1.0}}})


def test_under_sleeper_pads_add_their_own_compliance() -> None:
    """Under a long load the rail gains what the pads give: 1/(C · fill · half the sleeper)."""
    mesh = MeshSettings(size=0.3, growth=1.5, largest=1.5, border=Border(elements=7))
    modulus = 1e8

    def compliance(pad: dict[str, Any] | None) -> float:
        table: dict[str, Any] = {"model": "section"}
        if pad is not None:
            table["under_sleeper_pad"] = pad
        section = track_section(study(track=table).track(), 2.0, mesh)  # type: ignore[arg-type]
        k = 0.02
        return float(outputs(section, k, solve(section, k, 0.0))[0].real)

    plain = compliance(None)
    stiff = compliance({"bedding_modulus_n_per_m3": 1e12})
    soft = compliance({"bedding_modulus_n_per_m3": modulus})
    assert stiff == pytest.approx(plain, rel=2e-3)
    fill = 0.285 / 0.65
    # Both rails' loads are symmetric: each presses on half a sleeper. It bends a little.
    assert soft - stiff == pytest.approx(1.0 / (modulus * fill * 1.25), rel=0.15)


def test_other_arrangements_of_axles_are_built_and_written_out() -> None:
    vehicles = {
        "wagon": {
            "axles_per_bogie": 1, "car_length_m": 14.0, "bogie_spacing_m": 9.0, "body_mass_kg": 36e3,
            "body_inertia_kg_m2": 5e5, "wheelset_mass_kg": 1300.0, "axle_load_t": 19.3,
            "secondary_stiffness_n_per_m": 2e6, "secondary_damping_ns_per_m": 4e4,
        },
        "co_co": {"like": "power_car", "axles_per_bogie": 3, "axle_spacing_m": 1.9},
        "unit": {"like": "passenger", "bodies": 3, "car_length_m": 64.0},
    }  # fmt: skip
    consist = [
        {"vehicle": "co_co", "axle_loads_t": [20, 20, 20, 21, 21, 21]},
        {"vehicle": "wagon", "count": 2},
        {"vehicle": "unit"},
    ]
    study = toy.study()
    data = study.model_dump(by_alias=True, exclude_none=True) | {
        "vehicles": vehicles, "trains": {"passenger": {"consist": consist}},
    }  # fmt: skip
    study = Study.from_mapping(data)
    train = study.trains["passenger"]
    assert train.n_axles == 6 + 2 * 2 + 8
    assert train.cars[0].loads[-1] == 21e3
    again = study_from_text(resolved_toml(study).encode(), "again")
    assert again == study
    assert again.digest == study.digest
    assert again.trains["passenger"] == train
    consist[0]["axle_loads_t"] = [20, 20]
    with pytest.raises(InputError, match="axle_loads_t has 2 entries; 'co_co' has 6 axles"):
        Study.from_mapping(data)


def test_masses_of_one_rail_are_remarked_on_in_the_study() -> None:
    half = {"like": "passenger", "body_mass_kg": 12e3, "bogie_mass_kg": 2e3, "axle_load_t": 10.5}
    study = toy.study(vehicles={"half": half}, trains={"passenger": {"vehicle": "half", "cars": 2}})
    assert any(
        "vehicle 'half': its masses add up to 22.15 t, about half" in w for w in study.warnings
    )
    assert not any("masses" in warning for warning in toy.study().warnings)
