"""Files of others: a run writes into a folder of its own, and removes only what runs write.

A folder that is not empty and has no provenance is somebody's, whatever its files are called. Among
results, a table's folder holds nothing but that table's files.
"""

import re

from mcsettle.errors import InputError
from mcsettle.storage.files import ASIDE, UNFINISHED
from mcsettle.storage.location import Place
from mcsettle.storage.lock import LOCKS, is_lock
from mcsettle.storage.provenance import PROVENANCE
from mcsettle.storage.shard_name import ShardName
from mcsettle.storage.tables import TABLES

LOGS = ".log"
MOST_NAMED = 3  # files in a message
# Names of the tables' files that are no shards.
_SINGLE = re.compile(
    r"parameters/sets-[0-9]{6,}-[0-9]{6,}\.parquet|fits/set[0-9]{6,}\.parquet|"
    r"weights/weights\.parquet|summary/summary\.parquet|sign_split/sign_split\.parquet"
)


def refuse_others_folder(at: Place) -> None:
    """Refuse a folder that is not empty and holds no results: nothing is written there.

    What a run leaves that was stopped before its first result (locks, log) counts for nothing.

    Raises
    ------
    InputError
        The message names some of what is there.
    """
    entries = at.entries()
    if PROVENANCE in entries:
        return
    others = [name for name in entries if name not in (LOCKS, ASIDE, LOGS)]
    if not others and entries:
        others = [name for name in at.names(LOCKS) if not is_lock(name)]
        others += [name for name in at.unfinished() if not name.endswith(UNFINISHED)]
    if others:
        named = ", ".join(others[:MOST_NAMED]) + (", …" if len(others) > MOST_NAMED else "")
        raise InputError(
            f"'{at}' is not empty and holds no results ({named}); nothing there is touched: give a new "
            "or empty folder"
        )


def refuse_others_files(at: Place) -> None:
    """Refuse results with files in a table's folder that no run writes.

    Raises
    ------
    InputError
        The message names the first.
    """
    for table in TABLES:
        for name in at.names(table):
            if not is_ours(name):
                raise InputError(
                    f"'{at}/{name}' is of no run, and is neither read nor removed; move it out of "
                    "the results folder"
                )


def is_ours(name: str) -> bool:
    """Whether a file in a table's folder has a name that runs give.

    Examples
    --------
    >>> is_ours("history/base--A--00000000-00000063.parquet"), is_ours("history/2023.csv")
    (True, False)
    """
    return bool(_SINGLE.fullmatch(name)) or ShardName.read(name.rpartition("/")[2]) is not None
