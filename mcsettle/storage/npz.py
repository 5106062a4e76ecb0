"""Limits of the array files that are read: they may come from others, and are never unpickled."""

import tokenize
import zipfile
import zlib
from pathlib import Path

LARGEST = 4 * 1024**3  # bytes, unpacked
MOST_MEMBERS = 100_000
# What reading a damaged or hostile archive of arrays may raise.
DAMAGED = (
    OSError,
    EOFError,
    ValueError,
    MemoryError,
    OverflowError,
    RuntimeError,
    NotImplementedError,
    SyntaxError,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)


def refuse_large(path: Path) -> None:
    """Refuse an archive that would unpack to more than any of ours.

    Raises
    ------
    ValueError
        It is too large, or has too many members.
    OSError, zipfile.BadZipFile
        It cannot be read as an archive.
    """
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
    size = sum(member.file_size for member in members)
    if size > LARGEST or len(members) > MOST_MEMBERS:
        raise ValueError(f"it has {len(members)} arrays of {size} bytes, more than any of ours")
