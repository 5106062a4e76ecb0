"""Where the command line meets the user: messages, exit codes, folders, progress.

Results go to stdout, talk to stderr. Exit codes: 0 done, 1 a check or a computation failed, 2 usage
or bad input, 3 done with failed realisations, 5 precision target missed, 130
interrupted.
"""

import contextlib
import functools
import json
import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import ParamSpec, TypeVar

import typer

from mcsettle.errors import InputError, MissingPrecomputationError, NumericalError
from mcsettle.report.outgoing import json_text, lines, plain
from mcsettle.storage.files import is_url
from mcsettle.storage.location import Folder, place

P = ParamSpec("P")
R = TypeVar("R")

FAILED = 1
BAD_INPUT = 2
PARTIAL = 3
MISSED = 5
INTERRUPTED = 130


def talk(message: str) -> None:
    """One message to the person at the terminal (stderr)."""
    typer.echo(lines(message), err=True)


def say(text: str, is_data: bool = False, nl: bool = True) -> None:
    """A result (stdout); ``is_data``: JSON or TOML, in whose strings escapes stand for what is odd."""
    if is_data:
        text = json_text(text)
        if not (sys.stdout.encoding or "").lower().startswith("utf"):
            text = "".join(c if c.isascii() else json.dumps(c)[1:-1] for c in text)
    typer.echo(text if is_data else lines(text), nl=nl)


def prepare_streams() -> None:
    """Let output be written whatever stdout and stderr are: closed, or of a small character set."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by the caller: what is said there is lost, and nothing else
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")


def cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0))


def heed_termination() -> None:
    """Let SIGTERM, as batch systems send it, end a command like Ctrl-C."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    with contextlib.suppress(ValueError):  # not the main thread: somebody else's program
        signal.signal(signal.SIGTERM, interrupt)


def plainly(command: Callable[P, R]) -> Callable[P, R]:
    """Wrap a command so that what the user can mend ends in a message and an exit code."""

    @functools.wraps(command)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return command(*args, **kwargs)
        except KeyboardInterrupt:
            talk("\nInterrupted; nothing half-written. The same command goes on from here.")
            raise typer.Exit(INTERRUPTED) from None
        except BrokenPipeError:
            raise  # the reader of stdout has gone (`| head`): typer ends quietly
        except (InputError, MissingPrecomputationError, OSError) as error:
            talk(f"mcsettle: {error}")
            raise typer.Exit(BAD_INPUT) from None
        except NumericalError as error:
            talk(f"mcsettle: the computation failed: {error}")
            raise typer.Exit(FAILED) from None
        except MemoryError:
            talk(
                "mcsettle: the memory that this process may use does not suffice; free some, raise its "
                "limit, or give a smaller --batch: the same command goes on from what is there"
            )
            raise typer.Exit(FAILED) from None

    return wrapped


def refuse_url(path: Path, option: str) -> None:
    """Refuse a URL where files of this machine are written.

    Raises
    ------
    InputError
        ``path`` is one.
    """
    if is_url(path):
        raise InputError(
            f"{option}: a URL is no file of this machine, and nothing is written there; name a file or "
            "folder here and copy it to the store"
        )


def checked_folder(path: Path, option: str = "--out") -> Path:
    """``path`` if a run can write there; it is not created here.

    Raises
    ------
    InputError
        A file stands there, or its nearest existing parent cannot be written to.
    """
    refuse_url(path, option)
    if path.exists() and not path.is_dir():
        raise InputError(f"{option} {path} is a file; name a folder")
    parent = next(p for p in (path, *path.absolute().parents) if p.exists())
    if not parent.is_dir():
        raise InputError(f"{option} {path}: {parent} is a file; name a folder")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise InputError(
            f"{option} {path}: no permission to write in {parent}; name another folder"
        )
    return path


def checked_out(out: str) -> None:
    """Refuse an ``--out`` that no run can write to; a URL is tried when it is first written to.

    Raises
    ------
    InputError
        As ``checked_folder``.
    """
    at = place(out)
    if isinstance(at, Folder):
        checked_folder(at.path)


def own_folders(studies: list[Path], out: str) -> list[str]:
    """Folder or URL of the results of each study: ``out``, or for several one under it for each.

    Raises
    ------
    InputError
        If two studies' files have the same name.
    """
    if len(studies) == 1:
        return [out]
    names = [study.stem for study in studies]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(
            f"{', '.join(twice)}: several study files of this name; their results would go to one "
            "folder. Run them one by one, or rename one"
        )
    where, mark, options = out.partition("?") if is_url(out) else (out, "", "")
    return [f"{where.rstrip('/')}/{name}{mark}{options}" for name in names]


def with_cache(cache: str | None) -> None:
    """Use the folder or URL ``cache`` for what Step A computes, here and in spawned processes."""
    if cache is not None:
        os.environ["MCSETTLE_CACHE"] = cache


def together(
    shards: str | None, scheduler: str | None, until: str | None, max_minutes: float | None
) -> None:
    """Refuse options that contradict one another.

    Raises
    ------
    InputError
        A part of a run cannot know when the whole is precise enough.
    """
    if shards is not None and (until is not None or max_minutes is not None):
        raise InputError("--shards goes with neither --until nor --max-minutes; leave them out")
    if shards is not None and scheduler is not None:
        raise InputError("--shards and --scheduler are two ways of sharing a run; give one of them")


class Progress:
    """Progress on stderr: one line that is rewritten on a terminal, a line now and then elsewhere.

    Called as ``progress(stage, done, total)``, with ``done`` rising from 0 to ``total``.
    """

    def __init__(self, interval: float | None = None) -> None:
        self.terminal = sys.stderr.isatty()
        self.interval = interval if interval is not None else 0.2 if self.terminal else 15.0
        self.stage = ""
        self.started = self.shown = 0.0

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Report that ``done`` of ``total`` steps of ``stage`` are finished."""
        now = time.monotonic()
        if stage != self.stage:
            self._finish_line()
            self.stage, self.started, self.shown = stage, now, 0.0 if self.terminal else now
        if now - self.shown < self.interval and done < total:
            return
        self.shown = now
        text = f"{stage}: {done}/{total} {self._left(done, total, now)}"
        if self.terminal:
            sys.stderr.write(f"\r\033[K{plain(text)}")
            sys.stderr.flush()
        else:
            talk(text)
        if done >= total:
            self._finish_line()

    def _left(self, done: int, total: int, now: float) -> str:
        elapsed = now - self.started
        if done >= total:
            return f"({elapsed:.0f} s)"
        if done == 0 or elapsed < 1.0:
            return ""
        return f"({done / elapsed:.3g}/s, {(total - done) * elapsed / done:.0f} s left)"

    def _finish_line(self) -> None:
        if self.terminal and self.stage:
            sys.stderr.write("\n")
        self.stage = ""
