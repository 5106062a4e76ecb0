"""What a run consists of, how much of it is there, and closing it: effects, summary, manifest.

``survey`` looks at every shard; ``close`` wants all of them whole, writes the tables that follow from
them and the manifest. Neither computes a realisation, so both work on a folder alone.

Depends on: draws, economics, errors, fits, ledger, lock, observed, place, rows, shards, store, study,
study_read, summary, summary_table.
"""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

import mcsettle
from mcsettle import economics, ledger, lock, rows, store
from mcsettle.draws import ParameterSet, all_sets
from mcsettle.errors import InputError
from mcsettle.fits import Fit, read_fits, with_fits
from mcsettle.observed import Conditioning, conditioned
from mcsettle.place import Place, Where, place
from mcsettle.shards import Shard, all_shards, index_ranges
from mcsettle.study import Study
from mcsettle.summary import STUDY_FILE, read_results, study_of, summary_rows
from mcsettle.summary_table import summary_columns

MOST_NAMED = 5  # shards in a message


@dataclass(frozen=True)
class Fault:
    """A shard that is not whole: ``state`` is "missing", "damaged" or "failed"."""

    shard: str
    state: str
    reason: str


@dataclass(frozen=True)
class Survey:
    """What a results folder holds of its run.

    ``shards`` and ``whole`` by (variant, scenario); ``strays`` are files of no shard of this run;
    ``finished``: there is a manifest and every file agrees with it.
    """

    folder: str
    provenance: store.Provenance
    realisations: int
    parameter_sets: int
    shards: dict[tuple[str, str], int]
    whole: dict[tuple[str, str], int]
    n_failed: int
    faults: tuple[Fault, ...]
    strays: tuple[str, ...]
    owners: tuple[lock.Owner, ...]
    finished: bool
    remark: str = ""

    @property
    def n_shards(self) -> int:
        """Shards of the run."""
        return sum(self.shards.values())

    @property
    def n_whole(self) -> int:
        """Shards that are there and whole."""
        return sum(self.whole.values())


def survey(folder: Where) -> Survey:
    """Look at every shard of the run that ``folder`` holds.

    Raises
    ------
    InputError
        It is no results folder, or its study cannot be read.
    """
    at = place(folder)
    provenance, study = store.read_provenance(at), study_of(at)
    _refuse_other(at, provenance, study)
    shards = all_shards(study, provenance.shard_realisations)
    total, whole = dict[tuple[str, str], int](), dict[tuple[str, str], int]()
    faults, n_failed = [], 0
    held = held_shards(at)
    for shard in shards:
        key = (shard.variant, shard.scenario)
        total[key] = total.get(key, 0) + 1
        found = _fault(at, shard, provenance, shard.name in held)
        if isinstance(found, Fault):
            faults.append(found)
        else:
            whole[key] = whole.get(key, 0) + 1
            n_failed += found
    finished, remark = _is_finished(at)
    return Survey(
        folder=str(at),
        provenance=provenance,
        realisations=study.run.realisations,
        parameter_sets=study.n_sets,
        shards=total,
        whole={key: whole.get(key, 0) for key in total},
        n_failed=n_failed,
        faults=tuple(faults),
        strays=tuple(sorted(_strays(at, shards))),
        owners=tuple(lock.owners(at)),
        finished=finished and not faults,
        remark=remark,
    )


def held_shards(at: Place) -> set[str]:
    """Names of the shards that have a record."""
    names = (name.rpartition("/")[2] for name in at.names(ledger.RECORDS))
    return {name.removesuffix(".json") + ".parquet" for name in names if name.endswith(".json")}


def refuse_smaller(at: Place, held: set[str], study: Study) -> None:
    """Refuse a folder that already holds more than is asked for.

    Raises
    ------
    InputError
        The message names both numbers.
    """
    stems = [name.removesuffix(".parquet") for name in held]
    ends = [int(stem.rsplit("-", 1)[-1]) + 1 for stem in stems if stem[-8:].isdigit()]
    sets = [int(found[1]) + 1 for stem in stems if (found := re.search(r"--set(\d+)--", stem))]
    for kind, n, asked in (
        ("realisations", max(ends, default=0), study.run.realisations),
        ("parameter sets", max(sets, default=0), study.n_sets),
    ):
        if n > asked:
            raise InputError(
                f"'{at}' holds {n} {kind} and {asked} are asked for; "
                "ask for at least as many, or give another folder"
            )


def gather(folder: Where, take_over: bool = False) -> Survey:
    """Check that every shard of a run is there and whole, and close the run.

    Raises
    ------
    InputError
        Shards are missing or damaged (the message names them), somebody is at work in the folder, or
        it is no results folder.
    """
    at = place(folder)
    store.read_provenance(at)  # before anything is written there
    with lock.held(at, "gather", take_over):
        found = survey(at)
        bad = [fault for fault in found.faults if fault.state != "failed"]
        if bad:
            raise InputError(_incomplete(found, bad))
        study = study_of(at)
        refuse_smaller(at, held_shards(at), study)
        close(at, study, all_sets(study), found.provenance)
        return survey(at)


def close(
    at: Place, study: Study, members: list[ParameterSet], provenance: store.Provenance
) -> list[str]:
    """Write the tables that follow from whole shards, and the manifest, last; returns remarks."""
    at.remove(store.MANIFEST)
    at.sweep()
    shards = all_shards(study, provenance.shard_realisations)
    for name in _superseded(at, shards):  # first: the effects pair rows of one run only
        ledger.remove_shard(at, name)
    fits = read_fits(at, study)
    members = [with_fits(study, m, fits[m.index]) if m.index in fits else m for m in members]
    _write_parameters(at, study, members, provenance)
    _write_effects(at, study, members, provenance)
    remarks = _write_weights(at, study, fits, provenance)
    _write_summary(at, study, provenance)
    store.finish(at)
    return remarks


def count_failed(at: Place) -> int:
    """Failed realisations of a folder."""
    status = store.read(at, "realisations").column("status")
    return int(np.sum(np.asarray(status) == "failed"))


def _fault(at: Place, shard: Shard, provenance: store.Provenance, listed: bool) -> Fault | int:
    """What is wrong with a shard, or how many of its rows failed."""
    found = ledger.read_record(at, shard.name, provenance) if listed else None
    if found is None:
        reason = "its record is damaged or of another run" if listed else "not computed yet"
        return Fault(shard.name, "damaged" if listed else "missing", reason)
    reason = ledger.fault(at, shard.name, found, len(shard.indices)) or ""
    if reason:
        return Fault(shard.name, "damaged", reason)
    return Fault(shard.name, "failed", found.failure) if found.failure else found.n_failed


def _is_finished(at: Place) -> tuple[bool, str]:
    try:
        store.verify(at)
    except InputError as error:
        return False, str(error)
    return True, ""


def _incomplete(found: Survey, bad: list[Fault]) -> str:
    named = "; ".join(f"{fault.shard}: {fault.reason}" for fault in bad[:MOST_NAMED])
    more = f"; and {len(bad) - MOST_NAMED} more" if len(bad) > MOST_NAMED else ""
    return (
        f"'{found.folder}' has {found.n_whole} of {found.n_shards} shards ({named}{more}); run the "
        "study into it again: only what is missing is computed"
    )


def _refuse_other(at: Place, provenance: store.Provenance, study: Study) -> None:
    """Refuse a folder whose study is not the one its provenance names, or of another version."""
    if study.digest != provenance.study_digest:
        raise InputError(
            f"'{at}/{STUDY_FILE}' is not the study of this run (its digest is {study.digest}, the "
            f"run's {provenance.study_digest}); run the study into the folder again"
        )
    if provenance.package_version != mcsettle.__version__:
        raise InputError(
            f"'{at}' is of mcsettle {provenance.package_version}, this is {mcsettle.__version__}; "
            "use that version, or run the study into another folder"
        )


def _strays(at: Place, shards: list[Shard]) -> set[str]:
    """Files in the folders of shards that belong to none of them."""
    own = {shard.name for shard in shards}
    names = [name for table in (*ledger.SHARDED, "effects") for name in at.names(table)]
    return {name for name in names if name.partition("/")[2] not in own}


def _superseded(at: Place, shards: list[Shard]) -> set[str]:
    """Shards of an earlier, smaller run that those of this one contain."""
    names = {name.partition("/")[2] for name in _strays(at, shards)} | held_shards(at)
    return names - {shard.name for shard in shards}


def _write_parameters(
    at: Place, study: Study, members: list[ParameterSet], provenance: store.Provenance
) -> None:
    """The table ``parameters`` of a study with uncertain inputs."""
    if not study.nested:
        return
    name = f"sets-000000-{len(members) - 1:06d}.parquet"
    last = study.run.realisations - 1
    store.write(at, "parameters", name, rows.parameter_columns(members), provenance, 0, last)
    for other in at.names("parameters"):
        if other != f"parameters/{name}":
            at.remove(other)


def _write_weights(
    at: Place, study: Study, fits: dict[int, dict[str, Fit]], provenance: store.Provenance
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
            tables = (results.realisations, results.history)
            found.append(conditioned(study, variant, *tables))
    last = study.run.realisations - 1
    store.write(at, "weights", name, rows.weight_columns(found), provenance, 0, last)
    return [f"{one.variant}: {one.remark}" for one in found if one.remark]


def _write_effects(
    at: Place, study: Study, members: list[ParameterSet], provenance: store.Provenance
) -> None:
    """Pair every scenario with the baseline, realisation by realisation."""
    if study.economics is None:
        return
    frame = store.read(at, "realisations").to_pandas()
    own = ["variant", "parameter_set", "scenario"]
    parts = {key: g.sort_values("realisation") for key, g in frame.groupby(own)}
    ranges = index_ranges(study.run.realisations, provenance.shard_realisations)
    for variant in study.variant_names:
        for member in members:
            for scenario in study.scenario_names:
                effects = _effects(member, variant, scenario, parts)
                if effects is None:
                    continue
                for part in ranges:
                    ends = part.start, part.stop - 1
                    shard = Shard(member.index, variant, scenario, *ends, study.nested)
                    columns = rows.effect_columns(member, variant, scenario, part, effects)
                    store.write(at, "effects", shard.name, columns, provenance, *ends)


def _effects(
    member: ParameterSet,
    variant: str,
    scenario: str,
    parts: dict[Any, pd.DataFrame],
) -> economics.Effects | None:
    table, change = member.study.priced, member.study.change(scenario)
    if table is None or change is None:
        return None
    base = parts[variant, member.index, table.baseline]
    other = parts[variant, member.index, scenario]
    return economics.paired_effects(
        base["tamping_interval_days"].to_numpy(float),
        other["tamping_interval_days"].to_numpy(float),
        base["censored_at_days"].to_numpy(float),
        other["censored_at_days"].to_numpy(float),
        change,
        table.tamping_cost_gbp_per_track_km,
        table.discount_rate,
    )


def _write_summary(at: Place, study: Study, provenance: store.Provenance) -> None:
    """The table ``summary``: every number of the summary with its error."""
    results = read_results(at, finished=False)
    columns = summary_columns(summary_rows(results))
    if len(columns["variant"]):
        last = study.run.realisations - 1
        store.write(at, "summary", "summary.parquet", columns, provenance, 0, last)
