"""Which files a program makes, changes or removes, as it does: told by Python's own audit events.

What libraries write in C, such as compiled kernels, is not seen.
"""

import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

# Arguments of an event that are paths it changes, and of those that say which folder they begin in.
CHANGES = {
    "open": ((0,), ()),
    "os.rename": ((0, 1), (2, 3)),
    "os.remove": ((0,), (1,)),
    "os.rmdir": ((0,), (1,)),
    "os.mkdir": ((0,), (2,)),
    "os.link": ((1,), (3,)),
    "os.symlink": ((1,), (2,)),
    "os.truncate": ((0,), ()),
    "os.chmod": ((0,), (2,)),
    "os.chown": ((0,), (3,)),
    "os.utime": ((0,), (3,)),
}
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
Change = Callable[[str, tuple[str, ...]], None]


class Watch:
    """Calls ``change(event, paths)`` before every change of a file while it is ``on``."""

    def __init__(self, change: Change) -> None:
        self.change, self.on = change, False
        sys.addaudithook(self._hear)  # for as long as the process lives

    def _hear(self, event: str, arguments: tuple[object, ...]) -> None:
        if not self.on or event not in CHANGES:
            return
        if event == "open" and not (isinstance(arguments[2], int) and arguments[2] & WRITING):
            return
        places, folders = CHANGES[event]
        paths = tuple(
            _absolute(arguments[place], arguments[folder] if folder < len(arguments) else -1)
            for place, folder in zip(places, folders or (99,) * len(places), strict=True)
        )
        self.on = False
        try:
            self.change(event, paths)
        finally:
            self.on = True


def is_below(path: str, roots: Iterable[Path]) -> bool:
    """Whether ``path`` is one of ``roots`` or lies in one."""
    return any(path == str(root) or path.startswith(f"{root}/") for root in roots)


def _absolute(path: object, folder: object) -> str:
    if isinstance(path, int):
        return os.readlink(f"/proc/self/fd/{path}")
    text = os.fsdecode(path)  # type: ignore[arg-type]
    base = os.readlink(f"/proc/self/fd/{folder}") if isinstance(folder, int) and folder >= 0 else ""
    return os.path.abspath(os.path.join(base, text))
