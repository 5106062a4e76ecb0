"""Files that a study names: where they may lie, their digests, and what is read from them.

A name starts from the study's own folder and stays inside it, links followed, unless the study says
``files_outside = true``: a study from elsewhere reads nothing that does not come with it.
"""

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

from mcsettle.errors import InputError
from mcsettle.railway.ground_profiles import Ground, merging_remark, slabs
from mcsettle.railway.irregularity import wavenumbers
from mcsettle.railway.measured_profiles import Record, prepared
from mcsettle.storage.files import sha256
from mcsettle.study.build import build_grounds, build_record
from mcsettle.study.faults import Fault
from mcsettle.study.schema.grounds import GroundsTable
from mcsettle.study.schema.profile import ProfileTable, RecordTable

Locate = Callable[[str], Path]  # the path of a file by the name that the study gives it


def input_file(folder: Path | None, name: str, outside: bool = False) -> Path:
    """Path of the file ``name`` of a study that lies in ``folder`` (None: the working folder).

    Raises
    ------
    InputError
        The name leads out of the folder and ``outside`` is not set, or is no name of a file.
    """
    base = (folder or Path.cwd()).resolve()
    try:
        path = (base / name).resolve()
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(f"received {name!r}, which is no file name: {error}") from None
    if not outside and not path.is_relative_to(base):
        raise InputError(
            f"received {name!r}, which leads out of the study's folder; put the file there, or say "
            "files_outside = true at the top of the study"
        )
    return path


def digest_of(path: Path, expected: str | None, missing: bool = True) -> str:
    """SHA-256 of the file at ``path``; with ``missing`` a known digest stands for a lost file.

    Raises
    ------
    InputError
        There is no such file, or it is not the one expected.
    """
    try:
        state = path.stat()
        digest = _digest(path, state.st_size, state.st_mtime_ns) if path.is_file() else None
    except (OSError, ValueError):
        digest = None
    if digest is None:
        if expected is not None and missing:
            return expected
        raise InputError(f"{path} does not exist or is no file that can be read")
    if expected is not None and digest != expected:
        raise InputError(
            f"{path} is not the file that the study was made with (SHA-256 {digest[:12]}…, expected "
            f"{expected[:12]}…); put the old one back, or leave out sha256"
        )
    return digest


@lru_cache(maxsize=64)
def _digest(path: Path, size: int, modified: int) -> str:
    del size, modified  # they tell a changed file from the one that is known
    return sha256(path)


def profile_with_digest(profile: ProfileTable, locate: Locate) -> tuple[ProfileTable, list[Fault]]:
    """``profile`` with the digest of the record it names, and the faults of that name."""
    record = profile.record or RecordTable()
    if profile.file is None:
        return profile, []
    try:
        digest = digest_of(locate(profile.file), record.sha256)
    except InputError as error:
        return profile, [Fault("profile.file", str(error))]
    update = {"record": record.model_copy(update={"sha256": digest})}
    return profile.model_copy(update=update), []


def grounds_with_digests(table: GroundsTable, locate: Locate) -> tuple[GroundsTable, list[Fault]]:
    """``table`` with the digests of its two files, and the faults of their names."""
    faults, digests = [], []
    for place, key in enumerate(("layers", "weights")):
        expected = table.sha256[place] if table.sha256 else None
        try:
            digests.append(digest_of(locate(getattr(table, key)), expected))
        except InputError as error:
            faults.append(Fault(f"grounds.{key}", str(error)))
    return table.model_copy(update={"sha256": tuple(digests)}), faults


def read_grounds(table: GroundsTable, locate: Locate) -> tuple[Ground, ...]:
    """The grounds in the files of ``table``.

    Raises
    ------
    InputError
        A file cannot be read or used.
    """
    paths = [locate(name) for name in (table.layers, table.weights)]
    for path, digest in zip(paths, table.sha256 or (), strict=True):
        digest_of(path, digest, missing=False)
    return build_grounds(table, *paths)


def read_record(profile: ProfileTable, locate: Locate) -> Record | None:
    """The measured record of ``profile``, read, filtered and cut; None where there is none.

    Raises
    ------
    InputError
        The record cannot be read or used.
    """
    if profile.file is None or profile.record is None:
        return None
    path = locate(profile.file)
    choice = build_record(profile, path, digest_of(path, profile.record.sha256, missing=False))
    modes = wavenumbers(profile.window_m, profile.shortest_m, profile.longest_m)
    try:
        return prepared(choice, profile.window_m, modes)
    except InputError as error:
        raise InputError(f"profile.file '{profile.file}': {error}") from None


def record_remarks(profile: ProfileTable, locate: Locate) -> list[str]:
    """What is odd about the record of ``profile``, and what is done about it."""
    record = read_record(profile, locate)
    if record is None:
        return []
    repairs = profile.record.repair if profile.record else ()
    return [f"profile.file: {remark}" for remark in record.remarks] + [
        f"profile.file: {finding.kind}: {finding.text}; "
        + ("repaired, as asked for" if finding.kind in repairs else "left as they are")
        for finding in record.findings
    ]


def ground_remarks(table: GroundsTable | None, locate: Locate) -> list[str]:
    """Which layers of the grounds of ``table`` the slabs do not show."""
    if table is None:
        return []
    heights = slabs(table.fine_m, table.fine_depth_m, table.coarse_m, table.depth_m)
    remark = merging_remark(read_grounds(table, locate), heights)
    return [f"grounds: {remark}"] if remark else []
