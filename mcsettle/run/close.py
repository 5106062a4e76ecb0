"""Closing a run whose shards are whole: parameters, effects, weights, summary and manifest.

It works on a folder alone: no realisation of a shard is computed, and the few of the table ``sign_split``
follow from the study.
"""

from dataclasses import replace
from itertools import groupby

import numpy as np

from mcsettle.errors import InputError
from mcsettle.estimate.conditioning import Conditioning, conditioned
from mcsettle.run import columns
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
from mcsettle.study.parameter_sets import ParameterSet
from mcsettle.study.run_inputs import RunInputs, run_inputs
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
        stand = survey(at)
        bad = [fault for fault in stand.faults if fault.state != "failed"]
        if bad:
            raise InputError(_incomplete(stand, bad))
        run = run_inputs(study_of(at))
        refuse_smaller(at, held_shards(at), run.extent)
        if run.predicts_grounds:
            run = replace(run, sets=with_stored_errors(run.sets, at))
        close(at, run, stand.provenance)
        return survey(at)


def close(
    at: Place,
    run: RunInputs,
    provenance: Provenance,
    prepared: StepA | None = None,
    processes: Together = ALONE,
) -> list[str]:
    """Write the tables that follow from whole shards, and the manifest, last; returns remarks.

    ``prepared``: Step A of the central set; None: from the cache folder, or computed where needed.
    ``processes`` share the work on the tables ``effects`` and ``sign_split``.
    """
    at.remove(MANIFEST)
    at.sweep()
    shards = all_shards(run.extent, provenance.shard_realisations)
    for name in _superseded(at, shards):  # first: the effects pair rows of one run only
        shard_record.remove_shard(at, name)
    fits = read_fits(at, run)
    run = with_fits(run, fits)
    _write_parameters(at, run, provenance)
    _write_effects(at, run, shards, provenance, processes)
    remarks = _write_weights(at, run, fits, provenance)
    write_sign_split(at, run, provenance, prepared, processes)
    _write_summary(at, run, provenance)
    store.finish(at, run.currency)
    return remarks


def count_failed(at: Place) -> int:
    """Failed realisations of a folder."""
    status = store.read(at, "realisations").column("status")
    return int(np.sum(np.asarray(status) == "failed"))


def _incomplete(stand: Survey, bad: list[Fault]) -> str:
    named = "; ".join(f"{fault.shard}: {fault.reason}" for fault in bad[:MOST_NAMED])
    more = f"; and {len(bad) - MOST_NAMED} more" if len(bad) > MOST_NAMED else ""
    return (
        f"'{stand.folder}' has {stand.n_whole} of {stand.n_shards} shards ({named}{more}); run the "
        "study into it again: only what is missing is computed"
    )


def _superseded(at: Place, shards: list[Shard]) -> set[str]:
    """Shards of an earlier, smaller run that those of this one contain."""
    names = {name.partition("/")[2] for name in strays(at, shards)} | held_shards(at)
    return {name for name in names if ShardName.read(name)} - {shard.name for shard in shards}


def _write_parameters(at: Place, run: RunInputs, provenance: Provenance) -> None:
    """The table ``parameters`` of a study with uncertain inputs."""
    if not run.extent.nested:
        return
    name = f"sets-000000-{len(run.sets) - 1:06d}.parquet"
    table = columns.parameter_columns(run.sets, run.units)
    store.write(at, "parameters", name, table, provenance, 0, run.extent.realisations - 1)
    for other in at.names("parameters"):
        if other != f"parameters/{name}" and is_ours(other):
            at.remove(other)


def _write_weights(
    at: Place, run: RunInputs, fits: dict[int, dict[str, Fit]], provenance: Provenance
) -> list[str]:
    """The table ``weights`` of a study with observations; remarks on it."""
    name = "weights.parquet"
    at.remove(f"weights/{name}")
    if not run.observations:
        return []
    results = read_results(at, finished=False)
    conditionings = []
    for variant in run.extent.variants:
        if variant in run.fitted:
            logs = np.array([fits[e][variant].log_evidence for e in range(run.extent.n_sets)])
            conditionings.append(Conditioning(variant, logs))
        else:
            courses_of = courses(variant, results.realisations, results.history)
            conditionings.append(conditioned(variant, run.observations, courses_of))
    table = columns.weight_columns(conditionings)
    store.write(at, "weights", name, table, provenance, 0, run.extent.realisations - 1)
    return [f"{one.variant}: {one.remark}" for one in conditionings if one.remark]


def _write_effects(
    at: Place, run: RunInputs, shards: list[Shard], provenance: Provenance, processes: Together
) -> None:
    """Pair every scenario with its baselines, shard by shard: no more is held."""
    if run.effects:
        of_sets = groupby(shards, key=lambda shard: shard.member)
        processes.map(
            _write_effects_of_set,
            [(at, run.sets[k], list(of_set), provenance, run.currency) for k, of_set in of_sets],
        )


def _write_effects_of_set(
    at: Place, member: ParameterSet, shards: list[Shard], provenance: Provenance, currency: str
) -> None:
    """The effects of one parameter set."""
    for shard in shards:
        effects = [e for e in member.study.effects.values() if e.scenario == shard.scenario]
        if effects:
            days = _days(at, shard, provenance)
            paired = []
            for effect in effects:
                base = _days(at, replace(shard, scenario=effect.baseline), provenance)
                pairs = columns.paired(effect, member.study.economics, base, days)
                rows = columns.effect_columns(member, shard.variant, shard.indices, effect, pairs)
                paired.append(rows)
            table, ends = columns.joined(paired), (shard.first, shard.last)
            store.write(at, "effects", shard.name, table, provenance, *ends, currency)


def _days(at: Place, shard: Shard, provenance: Provenance) -> columns.Days:
    """Intervals and days censored at [R] of a shard, NaN for none."""
    rows = store.read_shard(at, "realisations", shard.name, provenance).sort_by("realisation")
    return rows[INTERVAL].to_numpy(), rows[CENSORED].to_numpy()


def _write_summary(at: Place, run: RunInputs, provenance: Provenance) -> None:
    """The table ``summary``: every number of the summary with its error."""
    results = read_results(at, finished=False)
    table = columns.summary_columns([*summary_rows(results), *sign_rows(results)])
    if len(table["variant"]):
        last = run.extent.realisations - 1
        store.write(at, "summary", "summary.parquet", table, provenance, 0, last)
