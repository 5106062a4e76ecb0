"""Where the command line meets the user: messages, exit codes, folders, progress.

Results go to stdout, messages and progress to stderr.
"""

import contextlib
import functools
import inspect
import json
import os
import re
import signal
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ParamSpec, TypeVar

import typer
from rich import progress as bars
from rich.console import Console

from mcsettle.errors import (
    InputError,
    MissingPrecomputationError,
    NumericalError,
    computing,
)
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
EXIT_CODES: Mapping[int, str] = {
    0: "done",
    FAILED: "a computation failed, or a check of validate or doctor",
    BAD_INPUT: "usage, or a study, file or folder that cannot be used",
    PARTIAL: "done, but some realisations failed",
    MISSED: "the precision of --until was not reached",
    INTERRUPTED: "interrupted; the same command goes on",
}
Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="No progress and no messages but warnings and errors.")
]


_PARAMETER = re.compile(
    r"\b(until|shard_size|shards|scheduler|take_over|parameter_sets|threads|force|csv)="
)


class _State:
    """What one command shares: whether it is quiet, and the bar that is on the terminal."""

    quiet = False
    bar: bars.Progress | None = None


def inform(message: str) -> None:
    """One message to the person at the terminal (stderr), unless they asked for quiet."""
    if not _State.quiet:
        warn(message)


def as_options(message: str) -> str:
    """``message`` of the model with its parameters written as this command's options.

    >>> as_options("give a larger shard_size= or split the study")
    'give a larger --shard-size or split the study'
    """
    return _PARAMETER.sub(lambda name: "--" + name[1].replace("_", "-"), message)


def warn(message: str) -> None:
    """One message that is always printed (stderr), above the bar where there is one."""
    if _State.bar is None:
        typer.echo(lines(message), err=True)
    else:
        _State.bar.console.print(lines(message), markup=False, highlight=False, soft_wrap=True)


def say(text: str, is_data: bool = False, nl: bool = True) -> None:
    """A result (stdout); ``is_data``: JSON or TOML, in whose strings escapes stand for what is odd."""
    if is_data:
        text = json_text(text)
        if not (sys.stdout.encoding or "").lower().startswith("utf"):
            text = "".join(c if c.isascii() else json.dumps(c)[1:-1] for c in text)
    typer.echo(text if is_data else lines(text), nl=nl)


def as_json(data: Any) -> str:
    """``data`` as JSON.

    Raises
    ------
    ValueError
        A number in it is not finite.
    """
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False)


def say_result(
    result: R, in_json: bool, data: Callable[[R], Any], words: Callable[[R], Iterable[str]]
) -> None:
    """``result`` on stdout: its ``data`` as JSON, or in ``words``, line by line."""
    say(as_json(data(result)) if in_json else "\n".join(words(result)), in_json)


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
    from mcsettle.step_a import processes

    return processes.cores()


def heed_termination() -> None:
    """Let SIGTERM, as batch systems send it, end a command like Ctrl-C."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    with contextlib.suppress(ValueError):  # not the main thread: somebody else's program
        signal.signal(signal.SIGTERM, interrupt)


def plainly(command: Callable[P, R]) -> Callable[P, R]:
    """Wrap a command: it takes ``--quiet``, and what its user can mend ends in a message and a code."""

    @functools.wraps(command)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        _State.quiet = bool(kwargs.pop("quiet", False))
        try:
            with computing():
                return command(*args, **kwargs)
        except KeyboardInterrupt:
            warn("\nInterrupted; nothing is half-written. The same command goes on from here.")
            raise typer.Exit(INTERRUPTED) from None
        except BrokenPipeError:
            raise  # the reader of stdout has gone (`| head`): typer ends quietly
        except (InputError, MissingPrecomputationError, OSError) as error:
            warn(as_options(f"mcsettle: {error}{_of_the_folder()}"))
            raise typer.Exit(BAD_INPUT) from None
        except NumericalError as error:
            warn(f"mcsettle: the computation failed: {error}")
            raise typer.Exit(FAILED) from None
        except MemoryError:
            warn(
                "mcsettle: the memory that this process may use does not suffice; free some, raise its "
                "limit, or give a smaller --batch: the same command goes on from what is there"
            )
            raise typer.Exit(FAILED) from None
        finally:
            _end_bar()
            _State.quiet = False

    signature = inspect.signature(command)
    quiet = inspect.Parameter(
        "quiet", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Quiet
    )
    parameters = [*signature.parameters.values(), quiet]
    wrapped.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    return wrapped


def _of_the_folder() -> str:
    """What to say of the folder that the command works in, where it is the cause of an error."""
    try:
        os.getcwd()
    except OSError:
        return " (the folder that this command was started in has been removed: change to another)"
    return ""


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


def checked_file(path: Path, endings: Sequence[str], option: str = "--out") -> Path:
    """``path`` if it has one of the ``endings`` and is no folder.

    Raises
    ------
    InputError
        Another ending, a folder stands there, or it is a URL.
    """
    refuse_url(path, option)
    if path.suffix.lower() not in endings:
        raise InputError(f"{option} {path}: choose a name that ends in {', '.join(endings)}")
    if path.is_dir():
        raise InputError(f"{option} {path} is a folder; name a file")
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
    """Progress on stderr: a bar on a terminal, elsewhere one line when a stage ends.

    Called as ``progress(stage, done, total)``, with ``done`` rising from 0 to ``total``.
    """

    def __init__(self) -> None:
        self.stage = ""
        self.started = 0.0
        self.counts = ""

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Report that ``done`` of ``total`` steps of ``stage`` are finished."""
        if _State.quiet:
            return
        if stage != self.stage:
            self._end()
            self.stage, self.started = stage, time.monotonic()
            if sys.stderr.isatty():
                _State.bar = _bar(stage, total)
        self.counts = f"{done}/{total}"
        if _State.bar is not None:
            _State.bar.update(_State.bar.task_ids[0], completed=done, total=total)
        if done >= total:
            self._end()

    def _end(self) -> None:
        if self.stage and _State.bar is None:
            inform(f"{self.stage}: {self.counts} ({time.monotonic() - self.started:.0f} s)")
        _end_bar()
        self.stage = ""


def _bar(stage: str, total: int) -> bars.Progress:
    columns = (
        bars.TextColumn("{task.description}", markup=False),
        bars.BarColumn(),
        bars.MofNCompleteColumn(),
        bars.TimeElapsedColumn(),
        bars.TextColumn("left"),
        bars.TimeRemainingColumn(),
    )
    bar = bars.Progress(*columns, console=Console(stderr=True))
    bar.add_task(plain(stage), total=total)
    bar.start()
    return bar


def _end_bar() -> None:
    """Leave the bar on the terminal as it is and go on below it."""
    if _State.bar is not None:
        _State.bar.stop()
        _State.bar = None
