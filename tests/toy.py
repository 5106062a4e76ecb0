"""The toy of Step B's tests: three-car trains on the closed-form track, a few realisations.

Published settlement parameters would take years of traffic to the limit; ``FACTOR`` makes it about a
month, so that every single axle passage can be followed.
"""

import functools
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from mcsettle.railway.irregularity import default_section, sample_profiles, wavenumbers
from mcsettle.railway.settlement_model import SettlementModel
from mcsettle.railway.spectra import spectrum
from mcsettle.railway.track import TOY_TRACK, BeamTrack, PowerLaw
from mcsettle.railway.traffic import Service, Timetable, Train
from mcsettle.railway.vehicle import FREIGHT, PASSENGER
from mcsettle.step_a.beam import BeamResponse, beam_response
from mcsettle.step_a.interaction import precompute
from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_b.case import Case
from mcsettle.step_b.stress import DEVIATOR
from mcsettle.storage import store
from mcsettle.study.study import Study
from mcsettle.units import KMH

FACTOR = 300.0
SD, SD_LIMIT, WINDOW = 1.03e-3, 1.5e-3, 200.0
LAWS = tuple(layer.law for layer in TOY_TRACK.layers)
# Every exponent 2: the second-order form is exact.
QUADRATIC_LAWS = tuple(replace(law, m=2.0) if isinstance(law, PowerLaw) else law for law in LAWS)
TRAINS = {
    "passenger": Train("passenger", (PASSENGER,) * 3),
    "freight": Train("freight", (FREIGHT,) * 3),
    "car": Train("car", (PASSENGER,)),
}
SPEEDS = {"passenger": 201 * KMH, "freight": 97 * KMH, "car": 201 * KMH}


full_beam_response_once = functools.cache(beam_response)


@functools.cache
def beam_response_once(track: BeamTrack, integration_depth: float = 5.5) -> BeamResponse:
    """Step A of a track, once a session.

    300 m is longer than the tests' trains by the reach of their stresses; the tests compare runs with
    one another, so the cut at 20 rad/m need not be converged.
    """
    return beam_response(track, integration_depth, period=300.0, cutoff=20.0)


def response() -> BeamResponse:
    return beam_response_once(TOY_TRACK)


@functools.cache
def transfer(
    train: str = "passenger", window: float = WINDOW, shortest: float = 3.0
) -> TransferFunctions:
    """Transfer functions of one train; ``shortest`` = 8 m leaves modes 6 to 25 of 200 m."""
    modes = wavenumbers(window, shortest)
    return precompute(TRAINS[train], SPEEDS[train], response(), modes)


def model(**changes) -> SettlementModel:
    return SettlementModel(**{"laws": LAWS, "settlement_factor": FACTOR, **changes})


def case(
    services=(("passenger", 72),),
    window: float = WINDOW,
    shortest: float = 3.0,
    sd_limit: float = SD_LIMIT,
    horizon: float = 1000.0,
    **changes,
) -> Case:
    """Case of ``services`` (train, times a day); ``changes`` go to the settlement model."""
    return Case(
        timetable=Timetable(tuple(Service(TRAINS[t], SPEEDS[t], n) for t, n in services)),
        transfers=tuple(transfer(t, window, shortest) for t, _ in services),
        model=model(**changes),
        window=window,
        sd_limit=sd_limit,
        horizon=horizon,
    )


def profiles(indices, sd: float = SD, window: float = WINDOW, shortest: float = 3.0) -> np.ndarray:
    """Initial amplitudes complex [R, K] m."""
    return sample_profiles(
        spectrum(), wavenumbers(window, shortest), window, 1, indices, sd, default_section(window)
    )


def deviator(state: np.ndarray) -> np.ndarray:
    """Deviator [J, 3] of stresses [J, 4]; its length is σ_d."""
    return state @ DEVIATOR.T


def cycles(settlement_model: SettlementModel, gone: float = 0.0) -> np.ndarray:
    """Cycles [L] each layer has seen after ``gone`` more."""
    before = [1.0 if law is None else settlement_model.cycles_before(law)
              for law in settlement_model.laws]  # fmt: skip
    return np.array(before) + gone


def study(**changes) -> Study:
    """The toy study cut down: three cars, four realisations, waves of 8 m and more, a month to the limit.

    ``changes`` replace keys of its tables, as in ``run={"realisations": 8}``; None leaves one out.
    """
    path = Path(__file__).resolve().parents[1] / "studies" / "toy.toml"
    data = tomllib.loads(path.read_text(encoding="utf-8"))
    data["trains"]["passenger"]["cars"] = 3
    quick = {
        "profile": {"shortest_m": 8.0},
        "settlement": {"settlement_factor": FACTOR},
        "limit": {"horizon_years": 2},
        "run": {"realisations": 4, "history_days": [0, 5, 20, 40]},
    }
    data.pop("calibration", None)
    data.pop("reference", None)
    for name in {**quick, **changes}:
        new = [table.get(name) for table in (quick, changes)]
        if name in changes and changes[name] is None:
            data.pop(name, None)
        elif isinstance(data.get(name), dict):
            for table in new:
                data[name] |= table or {}
        else:
            data[name] = next(value for value in reversed(new) if value is not None)
    return Study.from_mapping(data)


def scenario(name: str, speed: float, train: str = "passenger") -> dict[str, object]:
    """One train, 72 times a day."""
    return {"name": name, "timetable": [{"train": train, "speed_kmh": speed, "per_day": 72}]}


def tiny(**changes) -> Study:
    """The toy study whose run is its files and little else: one car, a few waves of a short section."""
    quick = {
        "trains": {"passenger": {"vehicle": "passenger", "cars": 1}},
        "profile": {"window_m": 70.0, "shortest_m": 15.0, "longest_m": 30.0},
        "run": {"realisations": 2, "history_days": [0, 20], **changes.pop("run", {})},
    }
    return study(**quick, **changes)


def table(folder: Path, name: str, scenario: str | None = None) -> pd.DataFrame:
    """One table of a results folder, its rows in the order of their keys."""
    frame = store.read(folder, name).to_pandas()
    keys = ["scenario", "realisation"] + (["day"] if name == "history" else [])
    frame = frame.sort_values(keys).reset_index(drop=True)
    return frame if scenario is None else frame[frame["scenario"] == scenario]


def everything(folder: Path) -> dict[str, bytes]:
    """Bytes of every file by name: results, not what the runs keep beside them."""
    paths = sorted(p for p in folder.rglob("*") if p.is_file())
    names = ((p.relative_to(folder).as_posix(), p) for p in paths)
    return {name: p.read_bytes() for name, p in names if not name.startswith((".log", ".locks"))}


# Uncertain inputs: of Step B alone, of the train, of money, of a law, of the vehicle.
SETS, N = 4, 5
N0 = {
    "input": "settlement.ballast_cycles_before",
    "also": ["settlement.subgrade_cycles_before"],
    "distribution": "log_uniform",
    "low": 3e4,
    "high": 1e6,
}
LOAD = {"input": "trains.passenger.axle_load_t", "distribution": "normal", "mean": 17, "sd": 0.85}
COST = {
    "input": "economics.tamping_cost_per_track_km",
    "distribution": "lognormal",
    "median": 5600,
    "log_sd": 0.395,
}
LAW = {
    "input": "track.layers.ballast.ballast_coefficient_per_mpa2",
    "distribution": "uniform",
    "low": 0.3,
    "high": 0.45,
}
SPRING = {
    "input": "trains.passenger.secondary_stiffness_n_per_m",
    "distribution": "uniform",
    "low": 4e5,
    "high": 5e5,
}
# A factor that is fitted to an observed interval.
FITTED = {
    "input": "settlement.settlement_factor",
    "distribution": "log_uniform",
    "low": 10.0,
    "high": 10_000.0,
    "fitted": True,
}
INTERVAL = {"scenario": "v201", "tamping_interval_days": 60.0, "error_days": 3.0}


def uncertain(*entries, **changes) -> Study:
    """The toy study with these uncertain inputs: ``SETS`` sets of ``N`` tracks."""
    return study(
        **{
            "run": {"realisations": N, "parameter_sets": SETS},
            "uncertain": list(entries),
            **changes,
        }
    )
