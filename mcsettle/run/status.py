"""What a run consists of and how much of it is there: every shard looked at, nothing computed."""

from dataclasses import dataclass

import mcsettle
from mcsettle.errors import InputError
from mcsettle.run.code_digest import code_digest
from mcsettle.run.shards import Shard, all_shards
from mcsettle.storage import lock, manifest, shard_record
from mcsettle.storage.location import Place, Where, place
from mcsettle.storage.manifest import STUDY_FILE
from mcsettle.storage.provenance import Provenance, read_provenance
from mcsettle.storage.shard_name import ShardName
from mcsettle.study.extent import Extent, extent_of
from mcsettle.summary.results import study_of


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
    provenance: Provenance
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
    provenance, study = read_provenance(at), study_of(at)
    _refuse_other(at, provenance, study.digest)
    extent = extent_of(study)
    shards = all_shards(extent, provenance.shard_realisations)
    total, whole = dict[tuple[str, str], int](), dict[tuple[str, str], int]()
    faults, n_failed = [], 0
    held = held_shards(at)
    for shard in shards:
        key = (shard.variant, shard.scenario)
        total[key] = total.get(key, 0) + 1
        fault_or_failures = _fault(at, shard, provenance, shard.name in held)
        if isinstance(fault_or_failures, Fault):
            faults.append(fault_or_failures)
        else:
            whole[key] = whole.get(key, 0) + 1
            n_failed += fault_or_failures
    finished, remark = _is_finished(at)
    return Survey(
        folder=str(at),
        provenance=provenance,
        realisations=extent.realisations,
        parameter_sets=extent.n_sets,
        shards=total,
        whole={key: whole.get(key, 0) for key in total},
        n_failed=n_failed,
        faults=tuple(faults),
        strays=tuple(sorted(strays(at, shards))),
        owners=tuple(lock.owners(at)),
        finished=finished and not faults,
        remark=remark,
    )


def held_shards(at: Place) -> set[str]:
    """Names of the shards that have a record."""
    names = (name.rpartition("/")[2] for name in at.names(shard_record.RECORDS))
    return {name.removesuffix(".json") + ".parquet" for name in names if name.endswith(".json")}


def refuse_smaller(at: Place, held: set[str], extent: Extent) -> None:
    """Refuse a folder that already holds more than is asked for.

    Raises
    ------
    InputError
        The message names both numbers.
    """
    names = [name for name in map(ShardName.read, held) if name is not None]
    ends = [name.last + 1 for name in names]
    sets = [1 if name.parameter_set is None else name.parameter_set + 1 for name in names]
    for kind, n, asked in (
        ("realisations", max(ends, default=0), extent.realisations),
        ("parameter sets", max(sets, default=0), extent.n_sets),
    ):
        if n > asked:
            raise InputError(
                f"'{at}' holds {n} {kind} and {asked} are asked for; "
                "ask for at least as many, or give another folder"
            )


def _fault(at: Place, shard: Shard, provenance: Provenance, listed: bool) -> Fault | int:
    """What is wrong with a shard, or how many of its rows failed."""
    record = shard_record.read_record(at, shard.name, provenance) if listed else None
    if record is None:
        reason = "its record is damaged or of another run" if listed else "not computed yet"
        return Fault(shard.name, "damaged" if listed else "missing", reason)
    reason = shard_record.fault(at, shard.name, record, len(shard.indices)) or ""
    if reason:
        return Fault(shard.name, "damaged", reason)
    return Fault(shard.name, "failed", record.failure) if record.failure else record.n_failed


def _is_finished(at: Place) -> tuple[bool, str]:
    try:
        manifest.verify(at)
    except InputError as error:
        return False, str(error)
    return True, ""


def _refuse_other(at: Place, provenance: Provenance, digest: str) -> None:
    """Refuse a folder whose study is not the one its provenance names, or of another version.

    ``digest`` of the study.
    """
    if digest != provenance.study_digest:
        raise InputError(
            f"'{at}/{STUDY_FILE}' is not the study of this run (its digest is {digest}, the "
            f"run's {provenance.study_digest}); run the study into the folder again"
        )
    if provenance.package_version != mcsettle.__version__:
        raise InputError(
            f"'{at}' is of mcsettle {provenance.package_version}, this is {mcsettle.__version__}; "
            "use that version, or run the study into another folder"
        )


def refuse_other_code(at: Place, provenance: Provenance) -> None:
    """Refuse to add to results of other sources of the same version.

    Raises
    ------
    InputError
        They are; those of versions that did not say so pass.
    """
    if provenance.code_digest not in ("", code_digest()):
        raise InputError(
            f"'{at}' was computed by other sources of mcsettle {provenance.package_version} (digest "
            f"{provenance.code_digest[:12]}, these have {code_digest()[:12]}); use those, or run the "
            "study into another folder"
        )


def strays(at: Place, shards: list[Shard]) -> set[str]:
    """Files in the folders of shards that belong to none of them."""
    of_shards = {shard.name for shard in shards}
    names = [name for table in (*shard_record.SHARDED, "effects") for name in at.names(table)]
    return {name for name in names if name.partition("/")[2] not in of_shards}
