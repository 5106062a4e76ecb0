"""``mcsettle init`` and ``schema``: what a study is written from, and with."""

from pathlib import Path
from typing import Annotated

import typer

from mcsettle.cli.terminal import inform, plainly, say
from mcsettle.errors import InputError

SCHEMA = "study.schema.json"  # the first line of every study names it for editors


def example_names(incomplete: str) -> list[str]:
    """Names of examples that begin so, for the completion of the shell."""
    from mcsettle.study.examples import example_titles

    return [name for name in example_titles() if name.startswith(incomplete)]


@plainly
def init(
    path: Annotated[
        Path | None, typer.Argument(help="File to write: study.toml, or NAME.toml of an example.")
    ] = None,
    example: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="An example, with its data files, instead.",
            autocompletion=example_names,
        ),
    ] = None,
    list_examples: Annotated[
        bool, typer.Option("--list", help="List the examples and write nothing.")
    ] = False,
) -> None:
    """Write a commented study file to start from; an existing file is never overwritten."""
    from mcsettle.study.examples import example_titles

    if list_examples:
        if path is not None or example is not None:
            raise InputError("--list writes nothing: leave out FILE and --example")
        titles = example_titles()
        width = max(map(len, titles))
        say("\n".join(f"{name:{width}}  {title}" for name, title in titles.items()), True)
        return
    study, contents = _contents(path, example)
    _write(contents)
    schema = study.parent / SCHEMA
    if not schema.exists():  # for editors; one that is there stays as it is
        schema.write_text(_schema_text() + "\n", encoding="utf-8")
    data = len(contents) - 1
    beside = f" and {data} data file{'s' if data > 1 else ''} beside it" if data else ""
    inform(f"Wrote {study}{beside}. Next: mcsettle check {study}")


def _contents(path: Path | None, example: str | None) -> tuple[Path, dict[Path, bytes]]:
    """The study to write, and what every file will contain."""
    from importlib.resources import files

    from mcsettle.study.examples import example_files

    if example is None:
        study = path or Path("study.toml")
        return study, {study: files("mcsettle.cli").joinpath("template.toml").read_bytes()}
    try:
        text, *data = example_files(example).items()
    except InputError as error:
        raise InputError(f"--example {error}; 'mcsettle init --list' describes them") from None
    study = path or Path(text[0])
    return study, {study: text[1]} | {study.parent / name: content for name, content in data}


def _write(contents: dict[Path, bytes]) -> None:
    """Write the study and its data; nothing where the study exists, or data of another content."""
    study, *data = contents
    different = [study] if study.exists() else []
    different += [
        file
        for file in data
        if file.exists() and not (file.is_file() and file.read_bytes() == contents[file])
    ]
    if different:
        files = ", ".join(map(str, different))
        verb = "exists" if len(different) == 1 else "exist"
        raise InputError(f"{files} {verb}; name another file or remove what exists first")
    for file, content in contents.items():
        try:
            if file.parent != study.parent:  # the study's own folder has to exist
                file.parent.mkdir(exist_ok=True)
            if not file.exists():
                with file.open("xb") as target:
                    target.write(content)
        except OSError as error:
            raise InputError(f"{file} cannot be written: {error.strerror}") from None


def _schema_text() -> str:
    import json

    from mcsettle.study.schema.study import json_schema

    return json.dumps(json_schema(), indent=2, ensure_ascii=False)


@plainly
def schema() -> None:
    """Print the JSON Schema of study files, for editors."""
    say(_schema_text(), True)
