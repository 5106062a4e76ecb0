"""``mcsettle init`` and ``schema``: what a study is written from, and with."""

from pathlib import Path
from typing import Annotated

import typer

from mcsettle.cli.terminal import inform, plainly, say
from mcsettle.errors import InputError


@plainly
def init(
    path: Annotated[Path, typer.Argument(help="File to write.")] = Path("study.toml"),
) -> None:
    """Write a commented study file to start from; an existing file is never overwritten."""
    from importlib.resources import files

    text = files("mcsettle.cli").joinpath("template.toml").read_text(encoding="utf-8")
    try:
        with path.open("x", encoding="utf-8") as target:
            target.write(text)
    except FileExistsError:
        raise InputError(f"{path} exists; name another file or remove it first") from None
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}") from None
    inform(f"Wrote {path}. Next: mcsettle check {path}")


@plainly
def schema() -> None:
    """Print the JSON Schema of study files, for editors."""
    import json

    from mcsettle.study.schema.study import json_schema

    say(json.dumps(json_schema(), indent=2, ensure_ascii=False), True)
