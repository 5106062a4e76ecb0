"""Closing a run whose shards are whole: parameters, effects, weights, summary and manifest.

It works on a folder alone: no realisation of a shard is computed, and the few of the table ``sign_split``
follow from the study.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from mcsettle import economics
from mcsettle.errors import InputError
from mcsettle.estimate.conditioning import Conditioning, conditioned
from mcsettle.run import columns as rows
from mcsettle.run.columns import summary_columns
from mcsettle.run.factor_fit import Fit, read_fits, with_fits
from mcsettle.run.shards import Shard, all_shards
from mcsettle.run.sign_split import write_sign_split
from mcsettle.run.status import (
    Fault,
    Survey,
    held_shards,
    refuse_other_code,
    refuse_smaller,
    strays,
    survey,
)
from mcsettle.run.surrogate import with_stored_errors
from mcsettle.step_a.processes import ALONE, Together
from mcsettle.step_a.transfers import StepA
from mcsettle.storage import lock, shard_record, store
from mcsettle.storage.foreign import is_ours, refuse_others_files
from mcsettle.storage.location import Place, Where, place
from mcsettle.storage.manifest import MANIFEST
from mcsettle.storage.provenance import Provenance, read_provenance
from mcsettle.storage.shard_name import ShardName
from mcsettle.study.effects import StudyEffect
from mcsettle.study.parameter_sets import ParameterSet, all_sets
from mcsettle.study.study import Study
from mcsettle.summary.courses import courses
from mcsettle.summary.results import CENSORED, INTERVAL, read_results, study_of
from mcsettle.summary.sign_split import sign_rows
from mcsettle.summary.summary import summary_rows

MOST_NAMED = 5  # shards in a message


def gather(folder: Where, take_over: bool = False) -> Survey:
    """Check that every shard of a run is there and whole, and close the run.

    Raises
    ------
    InputError
        Shards are missing or damaged (the message names them), somebody is at work in the folder, or
        it is no results folder.
    """
    at = place(folder)
    refuse_other_code(at, read_provenance(at))  # before anything is written there
    refuse_others_files(at)
    with lock.held(at, "gather", take_over):
        found = survey(at)
        bad = [fault for fault in found.faults if fault.state != "failed"]
        if bad:
            raise InputError(_incomplete(found, bad))
        study = study_of(at)
        refuse_smaller(at, held_shards(at), study)
        members = all_sets(study)
        if study.predicts_grounds:
            members = with_stored_errors(members, at)
        close(at, study, members, found.provenance)
        return survey(at)


def close(
    at: Place,
    study: Study,
    members: list[ParameterSet],
    provenance: Provenance,
    prepared: StepA | None = None,
    processes: Together = ALONE,
) -> list[str]:
    """Write the tables that follow from whole shards, and the manifest, last; returns remarks.

    ``prepared``: Step A of the central set; None: from the cache folder, or computed where needed.
    ``processes`` share the work on the table ``sign_split``.
    """
    at.remove(MANIFEST)
    at.sweep()
    shards = all_shards(study, provenance.shard_realisations)
    for name in _superseded(at, shards):  # first: the effects pair rows of one run only
        shard_record.remove_shard(at, name)
    fits = read_fits(at, study)
    members = [with_fits(study, m, fits[m.index]) if m.index in fits else m for m in members]
    _write_parameters(at, study, members, provenance)
    _write_effects(at, study, members, provenance)
    remarks = _write_weights(at, study, fits, provenance)
    write_sign_split(at, study, members, provenance, prepared, processes)
    _write_summary(at, study, provenance)
    store.finish(at, study.currency)
    return remarks


def count_failed(at: Place) -> int:
    """Failed realisations of a folder."""
    status = store.read(at, "realisations").column("status")
    return int(np.sum(np.asarray(status) == "failed"))


def _incomplete(found: Survey, bad: list[Fault]) -> str:
    named = "; ".join(f"{fault.shard}: {fault.reason}" for fault in bad[:MOST_NAMED])
    more = f"; and {len(bad) - MOST_NAMED} more" if len(bad) > MOST_NAMED else ""
    return (
        f"'{found.folder}' has {found.n_whole} of {found.n_shards} shards ({named}{more}); run the "
        "study into it again: only what is missing is computed"
    )


def _superseded(at: Place, shards: list[Shard]) -> set[str]:
    """Shards of an earlier, smaller run that those of this one contain."""
    names = {name.partition("/")[2] for name in strays(at, shards)} | held_shards(at)
    return {name for name in names if ShardName.read(name)} - {shard.name for shard in shards}


def _write_parameters(
    at: Place, study: Study, members: list[ParameterSet], provenance: Provenance
) -> None:
    """The table ``parameters`` of a study with uncertain inputs."""
    if not study.nested:
        return
    name = f"sets-000000-{len(members) - 1:06d}.parquet"
    last = study.run.realisations - 1
    store.write(at, "parameters", name, rows.parameter_columns(members), provenance, 0, last)
    for other in at.names("parameters"):
        if other != f"parameters/{name}" and is_ours(other):
            at.remove(other)


def _write_weights(
    at: Place, study: Study, fits: dict[int, dict[str, Fit]], provenance: Provenance
) -> list[str]:
    """The table ``weights`` of a study with observations; remarks on it."""
    name = "weights.parquet"
    at.remove(f"weights/{name}")
    if not study.observed:
        return []
    results = read_results(at, finished=False)
    found = []
    for variant in study.variant_names:
        if variant in study.fitted:
            logs = np.array([fits[e][variant].log_evidence for e in range(study.n_sets)])
            found.append(Conditioning(variant, logs))
        else:
            courses_of = courses(variant, results.realisations, results.history)
            found.append(conditioned(variant, study.observations, courses_of))
    last = study.run.realisations - 1
    store.write(at, "weights", name, rows.weight_columns(found), provenance, 0, last)
    return [f"{one.variant}: {one.remark}" for one in found if one.remark]


def _write_effects(
    at: Place, study: Study, members: list[ParameterSet], provenance: Provenance
) -> None:
    """Pair every scenario with its baselines, shard by shard: no more is held."""
    if not study.effects:
        return
    for shard in all_shards(study, provenance.shard_realisations):
        member = members[shard.member]
        effects = [e for e in member.study.effects.values() if e.scenario == shard.scenario]
        if effects:
            own = _days(at, shard, provenance)
            paired = []
            for effect in effects:
                base = _days(at, replace(shard, scenario=effect.baseline), provenance)
                paired.append(_paired(shard, member, effect, base, own))
            columns, ends = rows.joined(paired), (shard.first, shard.last)
            store.write(at, "effects", shard.name, columns, provenance, *ends, study.currency)


def _days(at: Place, shard: Shard, provenance: Provenance) -> tuple[np.ndarray, np.ndarray]:
    """Intervals and days censored at [R] of a shard, NaN for none."""
    found = store.read_shard(at, "realisations", shard.name, provenance).sort_by("realisation")
    return found[INTERVAL].to_numpy(), found[CENSORED].to_numpy()


def _paired(
    shard: Shard,
    member: ParameterSet,
    effect: StudyEffect,
    base: tuple[np.ndarray, np.ndarray],
    other: tuple[np.ndarray, np.ndarray],
) -> dict[str, Any]:
    """Columns of one effect of a shard: its days beside those of the baseline."""
    prices = member.study.economics
    assert prices is not None
    effects = economics.paired_effects(
        *(base[0], other[0], base[1], other[1]),
        effect.change,
        prices.tamping_cost_per_track_km,
        prices.discount_rate,
    )
    return rows.effect_columns(member, shard.variant, shard.indices, effect, effects)


def _write_summary(at: Place, study: Study, provenance: Provenance) -> None:
    """The table ``summary``: every number of the summary with its error."""
    results = read_results(at, finished=False)
    columns = summary_columns([*summary_rows(results), *sign_rows(results)])
    if len(columns["variant"]):
        last = study.run.realisations - 1
        store.write(at, "summary", "summary.parquet", columns, provenance, 0, last)
