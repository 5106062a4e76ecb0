"""The chain: study → transfer functions → engine → tables. Run a study, or one scenario of it.

Realisations are cut into shards of fixed index ranges; each shard is one atomic file per table, so an
interrupted run goes on where it stopped and the tables do not depend on batches, threads or pauses.

Depends on: case, economics, engine, errors, irregularity, step_a, store, study, units.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import mcsettle
from mcsettle import economics, engine, store
from mcsettle.case import Case, Outcome
from mcsettle.errors import InputError
from mcsettle.irregularity import default_section, sample_profiles, spectrum
from mcsettle.step_a import Progress, StepA, step_a, study_wavenumbers
from mcsettle.study import Study, resolved_toml
from mcsettle.units import DAYS_PER_YEAR, MGT, MM

SHARD = 2048
CHECKED_REALISATIONS = 4


@dataclass(frozen=True)
class Finished:
    """A finished run: its folder, how many rows failed, and the remarks to pass on."""

    folder: Path
    n_failed: int
    remarks: tuple[str, ...]


def build_case(study: Study, prepared: StepA, variant: str, scenario: str) -> Case:
    """The engine's description of one variant and scenario."""
    settings = study.settlement_settings(variant)
    return Case(
        timetable=study.timetable(scenario),
        transfers=prepared.transfers[variant, scenario],
        model=settings.model(study.track(variant)),
        window=study.profile.window_m,
        sd_limit=study.limit.sd_limit,
        horizon=study.limit.horizon_days,
    )


def initial_profiles(study: Study, indices: range) -> np.ndarray:
    """Initial amplitudes complex [R, K] m of the realisations ``indices``, the same in every scenario."""
    profile = study.profile
    return sample_profiles(
        spectrum(profile.spectrum, profile.fra_class),
        study_wavenumbers(study),
        profile.window_m,
        study.seed,
        indices,
        sd=profile.sd,
        section=default_section(profile.window_m),
    )


def sample_days(study: Study) -> np.ndarray:
    """Days at which histories are recorded: the study's, the start and the first year."""
    days = {0.0, DAYS_PER_YEAR, *study.run.history_days}
    return np.array(sorted(day for day in days if day <= study.limit.horizon_days))


def run_study(
    study: Study,
    out: Path,
    realisations: int | None = None,
    seed: int | None = None,
    threads: int | None = None,
    batch: int | None = None,
    exact: bool = False,
    progress: Progress | None = None,
    processes: int = 1,
) -> Finished:
    """Run every variant and scenario of ``study`` into the folder ``out``; resumes what is there.

    Parameters
    ----------
    study : Study
    out : folder of the results
    realisations, seed : replace the study's own
    threads : Taichi threads (None: all cores)
    batch : realisations advanced at a time; changes memory and speed, not results
    exact : update after every axle passage, whatever the study's stepping
    progress : called as progress(stage, done, total)
    processes : spawned for Step A (more than 1 needs a main guard in the calling program)

    Raises
    ------
    InputError
        The folder cannot be written or holds results of something else.
    """
    study = study.with_run(realisations, seed, "every_axle" if exact else None)
    prepared = step_a(study, progress, processes)
    provenance = _provenance(study, prepared)
    ranges = list(_ranges(study.run.realisations))
    _refuse_smaller(out, study.run.realisations)
    store.prepare(out, provenance)
    store.write_text(out, "study.toml", resolved_toml(study))
    remarks = []
    for variant in study.variant_names:
        for scenario in study.scenario_names:
            case = build_case(study, prepared, variant, scenario)
            todo = [r for r in ranges if not _is_done(out, variant, scenario, r)]
            if not todo:
                continue
            remark = _check_expansion(study, case, variant, scenario)
            remarks += [remark] if remark else []
            run = study.run
            machine = engine.Engine(case, run.stepping, run.right_hand_side, threads=threads)
            for indices in todo:
                tables = _shard(study, machine, variant, scenario, indices, batch, progress)
                _write_shard(out, variant, scenario, indices, tables, provenance)
    _drop_superseded(study, out, ranges)  # first: the effects pair rows of one run only
    _write_effects(study, out, provenance, ranges)
    store.finish(out)
    rows = store.read(out, "realisations")
    n_failed = int(np.sum(np.asarray(rows["status"]) == "failed"))
    return Finished(out, n_failed, tuple(remarks))


def realisation_columns(
    study: Study, variant: str, scenario: str, indices: range, case: Case, outcome: Outcome
) -> dict[str, Any]:
    """Columns of the ``realisations`` table for one batch."""
    n = len(outcome.days)
    reached, failed = outcome.reached, outcome.failed
    year = int(np.flatnonzero(sample_days(study) == DAYS_PER_YEAR)[0]) if _has_year(study) else None
    growth = np.full(n, np.nan) if year is None else outcome.history[:, year] - outcome.sd_initial
    days_run = outcome.passages / case.timetable.passages_per_day
    horizon = np.where(reached | failed, np.nan, study.limit.horizon_days)
    reason = "the profile overflowed or the step collapsed"
    return {
        "variant": [variant] * n,
        "scenario": [scenario] * n,
        "parameter_set": np.zeros(n, np.int32),
        "realisation": np.arange(indices.start, indices.stop),
        "status": np.where(failed, "failed", np.where(reached, "reached", "censored")).tolist(),
        "tamping_interval_days": _nullable(outcome.days),
        "censored_at_days": _nullable(horizon),
        "passages": outcome.passages,
        "tonnage_mgt": days_run * case.timetable.mass_per_day / MGT,
        "sd_initial_mm": outcome.sd_initial / MM,
        "sd_final_mm": outcome.sd_final / MM,
        "mean_settlement_mm": outcome.mean_settlement / MM,
        "sd_growth_1y_mm": _nullable(growth / MM),
        "failure": [reason if f else None for f in failed],
    }


def history_columns(
    study: Study, variant: str, scenario: str, indices: range, outcome: Outcome
) -> dict[str, Any]:
    """Columns of the ``history`` table: SD at the sample days before the end, and at the end."""
    days = np.broadcast_to(sample_days(study), outcome.history.shape)
    end = np.where(outcome.reached, outcome.days, study.limit.horizon_days)
    days = np.column_stack([days, end])
    sd = np.column_stack([outcome.history, np.where(outcome.reached, outcome.sd_final, np.nan)])
    row, column = np.nonzero(np.isfinite(sd))
    n = len(row)
    return {
        "variant": [variant] * n,
        "scenario": [scenario] * n,
        "parameter_set": np.zeros(n, np.int32),
        "realisation": row + indices.start,
        "day": days[row, column],
        "sd_mm": sd[row, column] / MM,
    }


def _is_done(out: Path, variant: str, scenario: str, indices: range) -> bool:
    """Whether a shard is on disk, whole: ``realisations`` is written last."""
    name = store.shard_name(variant, scenario, indices.start, indices.stop - 1)
    history = store.shard_rows(out / "history" / name)
    return store.shard_rows(out / "realisations" / name) == len(indices) and history is not None


def _shard(
    study: Study,
    machine: engine.Engine,
    variant: str,
    scenario: str,
    indices: range,
    batch: int | None,
    progress: Progress | None,
) -> dict[str, dict[str, Any]]:
    """Compute one shard: the columns of ``history`` and of ``realisations``, in that order."""
    text, horizon = f"Step B: {variant} {scenario}", int(machine.case.horizon)

    def tick(day: float) -> None:
        if progress is not None:
            progress(text + ", day", min(int(day), horizon), horizon)

    rows, history = [], []
    size = min(batch or SHARD, SHARD)
    for first in range(indices.start, indices.stop, size):
        part = range(first, min(first + size, indices.stop))
        outcome = machine.run(initial_profiles(study, part), sample_days(study), tick=tick)
        rows.append(realisation_columns(study, variant, scenario, part, machine.case, outcome))
        history.append(history_columns(study, variant, scenario, part, outcome))
        if progress is not None:
            progress(text, part.stop, study.run.realisations)
    return {"history": _joined(history), "realisations": _joined(rows)}


def _write_shard(
    out: Path,
    variant: str,
    scenario: str,
    indices: range,
    tables: dict[str, dict[str, Any]],
    provenance: store.Provenance,
) -> None:
    name = store.shard_name(variant, scenario, indices.start, indices.stop - 1)
    for table, columns in tables.items():
        store.write(out, table, name, columns, provenance, indices.start, indices.stop - 1)


def _write_effects(
    study: Study, out: Path, provenance: store.Provenance, ranges: list[range]
) -> None:
    """Pair every scenario with the baseline, realisation by realisation."""
    table = study.economics
    if table is None:
        return
    frame = store.read(out, "realisations").to_pandas()
    for variant in study.variant_names:
        own = frame[frame["variant"] == variant]
        pivot = {s: g.sort_values("realisation") for s, g in own.groupby("scenario")}
        for scenario in study.scenario_names:
            change = study.change(scenario)
            if change is None:
                continue
            base, other = pivot[table.baseline], pivot[scenario]
            effects = economics.paired_effects(
                base["tamping_interval_days"].to_numpy(float),
                other["tamping_interval_days"].to_numpy(float),
                base["censored_at_days"].to_numpy(float),
                other["censored_at_days"].to_numpy(float),
                change,
                table.tamping_cost_gbp_per_track_km,
                table.discount_rate,
            )
            _write_pairs(study, variant, scenario, effects, out, provenance, ranges)


def _write_pairs(
    study: Study,
    variant: str,
    scenario: str,
    effects: economics.Effects,
    out: Path,
    provenance: store.Provenance,
    ranges: list[range],
) -> None:
    assert study.economics is not None
    for indices in ranges:
        part = slice(indices.start, indices.stop)
        n = len(indices)
        columns = {
            "variant": [variant] * n,
            "scenario": [scenario] * n,
            "baseline": [study.economics.baseline] * n,
            "parameter_set": np.zeros(n, np.int32),
            "realisation": np.arange(indices.start, indices.stop),
            "status": effects.status[part].tolist(),
            "reduction_percent": _nullable(effects.reduction_percent[part]),
            "elasticity": _nullable(effects.elasticity[part]),
            "marginal_cost": _nullable(effects.marginal_cost[part]),
            "effect": [study.economics.effect] * n,
        }
        name = store.shard_name(variant, scenario, indices.start, indices.stop - 1)
        store.write(out, "effects", name, columns, provenance, indices.start, indices.stop - 1)


def _check_expansion(study: Study, case: Case, variant: str, scenario: str) -> str | None:
    """Compare the second-order form with every x and depth on fixed indices; a remark if it is off."""
    if study.run.right_hand_side != "spectral":
        return None
    n = min(CHECKED_REALISATIONS, study.run.realisations)
    profiles = initial_profiles(study, range(n))
    rough = engine.expansion_error(case, profiles)
    if rough > 3e-3:
        return (
            f"{variant} {scenario}: the second-order form is off by {rough:.1%} of the growth; "
            'set [run] right_hand_side = "pointwise"'
        )
    return None


def _provenance(study: Study, prepared: StepA) -> store.Provenance:
    from mcsettle.kernels import runtime, spectral

    return store.Provenance(
        package_version=mcsettle.__version__,
        study_digest=study.digest,
        transfer_digest=prepared.digest,
        seed=study.seed,
        taichi_version=runtime.version(),
        precision="f64",
        lanes=spectral.LANES,
    )


def _ranges(n: int) -> Iterator[range]:
    for first in range(0, n, SHARD):
        yield range(first, min(n, first + SHARD))


def _refuse_smaller(out: Path, n: int) -> None:
    """Refuse a folder that already holds more realisations than asked for."""
    held = [int(p.stem.rsplit("-", 1)[-1]) + 1 for p in (out / "realisations").glob("*.parquet")]
    if held and max(held) > n:
        raise InputError(
            f"'{out}' holds {max(held)} realisations and {n} are asked for; "
            "ask for at least as many, or give another folder"
        )


def _drop_superseded(study: Study, out: Path, ranges: list[range]) -> None:
    """Remove shards of an earlier, smaller run that the shards of this one contain."""
    wanted = {
        store.shard_name(v, s, r.start, r.stop - 1)
        for v in study.variant_names
        for s in study.scenario_names
        for r in ranges
    }
    for table in ("realisations", "history", "effects"):
        for path in (out / table).glob("*.parquet"):
            if path.name not in wanted:
                path.unlink()


def _joined(parts: list[dict[str, Any]]) -> dict[str, Any]:
    return {key: [v for part in parts for v in part[key]] for key in parts[0]}


def _nullable(values: np.ndarray) -> list[float | None]:
    return [None if np.isnan(v) else float(v) for v in values]


def _has_year(study: Study) -> bool:
    return study.limit.horizon_days >= DAYS_PER_YEAR
