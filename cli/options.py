"""Arguments and options that several commands share, each described once."""

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, ParamSpec, TypeVar, get_type_hints

from typer import Argument, BadParameter, Option

from mcsettle.errors import InputError

P = ParamSpec("P")
R = TypeVar("R")

StudyFile = Annotated[Path, Argument(metavar="STUDY", help="Study file (TOML).")]
StudyFiles = Annotated[
    list[Path], Argument(metavar="STUDY...", help="Study file (TOML), or several.")
]
Folder = Annotated[Path, Argument(metavar="DIR", help="Folder of a run, or its URL.")]


def as_allowed(n: int | None) -> int | None:
    """As many realisations or parameter sets as ``MCSETTLE_REALISATIONS`` allows."""
    from mcsettle.study.sample_cap import capped

    try:
        return None if n is None else capped(n)
    except InputError as error:
        raise BadParameter(str(error)) from None


Realisations = Annotated[int | None, Option(min=1, callback=as_allowed, help="Tracks to simulate.")]
ParameterSets = Annotated[
    int | None, Option(min=1, callback=as_allowed, help="Draws of the uncertain inputs.")
]
Threads = Annotated[int | None, Option(min=1, help="Threads (default: all cores).")]
Batch = Annotated[int | None, Option(min=1, help="Realisations at a time.")]
Exact = Annotated[bool, Option("--exact", help="Update the profile after every axle passage.")]
Variant = Annotated[str | None, Option(help="Variant (default: the first).")]
Force = Annotated[bool, Option("--force", help="Replace files that are not this study's own.")]
Json = Annotated[bool, Option("--json", help="Print JSON.")]
TakeOver = Annotated[
    bool, Option("--take-over", help="Take away locks that other hosts have left there.")
]


def taking(options: type) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Give a command's ``**options`` the keys of the typed dictionary ``options``, None by default."""

    def wrap(command: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(command)
        named = [p for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD]
        more = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=hint)
            for name, hint in get_type_hints(options, include_extras=True).items()
        ]
        command.__signature__ = signature.replace(parameters=[*named, *more])  # type: ignore[attr-defined]
        return command

    return wrap


def option_name(options: type, key: str) -> str:
    """How a user writes the option ``key`` of the typed dictionary ``options``."""
    declared = get_type_hints(options, include_extras=True)[key].__metadata__[0].default
    return declared if isinstance(declared, str) else f"--{key.replace('_', '-')}"
