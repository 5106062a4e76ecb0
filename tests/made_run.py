"""Finished runs written by hand: intervals as given, so that what a report says is known beforehand."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from mcsettle.economics import paired_effects
from mcsettle.run import columns as rows
from mcsettle.storage import store
from mcsettle.storage.files import write_file
from mcsettle.storage.provenance import Provenance
from mcsettle.storage.shard_name import shard_name
from mcsettle.study.parameter_sets import ParameterSet, all_sets
from mcsettle.study.study import Study, resolved_toml

TOY = Path(__file__).resolve().parents[1] / "studies" / "toy.toml"


def study(**changes: Any) -> Study:
    """The toy study with tables replaced or, where both are tables, updated."""
    data = tomllib.loads(TOY.read_text(encoding="utf-8"))
    for name, new in changes.items():
        if isinstance(new, dict) and isinstance(data.get(name), dict):
            data[name] |= new
        elif new is None:
            data.pop(name, None)
        else:
            data[name] = new
    return Study.from_mapping(data)


def tonnage_study(**changes: Any) -> Study:
    """A baseline of 72 passenger trains, and one more freight train."""
    trains = {
        "passenger": {"vehicle": "passenger", "cars": 11},
        "freight": {"vehicle": "freight", "cars": 40},
    }
    base = [{"train": "passenger", "speed_kmh": 200.0, "per_day": 72}]
    more = [*base, {"train": "freight", "speed_kmh": 97.0, "per_day": 1}]
    scenarios = [{"name": "A", "timetable": base}, {"name": "C", "timetable": more}]
    economics = {"effect": "tonnage", "baseline": "A"}
    given = {"trains": trains, "scenarios": scenarios, "economics": economics, "calibration": None}
    return study(**(given | changes))


def write(folder: Path, made: Study, days: dict[str, Any], failed: tuple[int, ...] = ()) -> Path:
    """A run of ``made`` in ``folder``: ``days`` by scenario, NaN where the horizon came first.

    Each parameter set is a hundredth slower than the one before.
    """
    provenance = Provenance("0", made.digest, "0" * 64, made.seed, "1.7.4", "f64", 8)
    store.prepare(folder, provenance)
    files = {}
    for key, (
        _,
        path,
    ) in made.input_files().items():  # kept beside the results, as a run keeps them
        files[key] = f"inputs/{key}/{path.name}"
        (folder / files[key]).parent.mkdir(parents=True)
        write_file(folder / files[key], path.read_bytes())
    write_file(folder / "study.toml", resolved_toml(made, files).encode())
    given = {name: np.asarray(d, dtype=float) for name, d in days.items()}
    bad = np.isin(np.arange(len(next(iter(given.values())))), failed)
    for member in all_sets(made):
        slower = 1.0 + 0.01 * member.index
        values = {name: np.where(bad, np.nan, slower * d) for name, d in given.items()}
        ends = {name: _ends(made, d, bad) for name, d in values.items()}
        for variant in made.variant_names:
            for scenario, d in values.items():
                _shard(folder, made, provenance, variant, scenario, d, ends[scenario], bad, member)
            _effects(folder, made, provenance, variant, values, ends, member)
    store.finish(folder, made.currency)
    return folder


def _name(made: Study, variant: str, scenario: str, n: int, member: ParameterSet) -> str:
    return shard_name(variant, scenario, 0, n - 1, member.index if made.nested else None)


def _ends(made: Study, days: np.ndarray, bad: np.ndarray) -> np.ndarray:
    return np.where(np.isnan(days) & ~bad, made.limit.horizon_days, np.nan)


def _shard(folder, made, provenance, variant, scenario, days, ends, bad, member) -> None:
    n = len(days)
    reached = np.isfinite(days)
    start, limit = made.profile.sd_mm or 1.0, made.limit.sd_limit_mm
    keys = {"variant": [variant] * n, "scenario": [scenario] * n}
    keys |= {"parameter_set": np.full(n, member.index, np.int32), "realisation": np.arange(n)}
    status = np.where(bad, "failed", np.where(reached, "reached", "censored"))
    growth = np.where(days > 365.0, (limit - start) * 365.0 / days, np.nan)
    table = keys | {
        "status": status.tolist(),
        "tamping_interval_days": days,
        "censored_at_days": ends,
        "passages": np.full(n, 1000),
        "tonnage_mgt": np.ones(n),
        "sd_initial_mm": np.full(n, start),
        "sd_final_mm": np.where(reached, limit, 0.5 * (start + limit)),
        "mean_settlement_mm": np.ones(n),
        "sd_growth_1y_mm": growth,
        "failure": [rows.FAILURE if b else None for b in bad],
    }
    table |= rows.input_columns(member, n)
    name = _name(made, variant, scenario, n, member)
    store.write(folder, "realisations", name, table, provenance, 0, n - 1)
    last = np.where(reached, days, made.limit.horizon_days)
    sampled = [d for d in (0.0, *made.run.history_days) if d <= made.limit.horizon_days]
    entries = [
        (int(i), d, start + (limit - start) * d / last[i])
        for i in range(n)
        for d in sorted({*sampled})
        if d <= last[i] and not bad[i]
    ]
    m = len(entries)
    history = {"variant": [variant] * m, "scenario": [scenario] * m}
    history |= {"parameter_set": np.full(m, member.index, np.int32)}
    history |= {"realisation": np.array([e[0] for e in entries], dtype=np.int64)}
    history |= {"day": [e[1] for e in entries], "sd_mm": [e[2] for e in entries]}
    store.write(folder, "history", name, history, provenance, 0, n - 1)


def _effects(folder, made, provenance, variant, values, ends, member) -> None:
    prices, n = member.study.economics, len(next(iter(values.values())))
    for scenario in made.scenario_names:
        found = []
        for effect in member.study.effects.values():
            if effect.scenario != scenario or prices is None:
                continue
            base = effect.baseline
            effects = paired_effects(
                values[base], values[scenario], ends[base], ends[scenario], effect.change,
                prices.tamping_cost_per_track_km, prices.discount_rate,
            )  # fmt: skip
            found.append(rows.effect_columns(member, variant, range(n), effect, effects))
        if found:
            name, last = _name(made, variant, scenario, n, member), n - 1
            columns = rows.joined(found)
            store.write(folder, "effects", name, columns, provenance, 0, last, made.currency)
