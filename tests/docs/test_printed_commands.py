"""Every printed command runs as it is printed: of README and docs, of help texts, of next-step hints.

The fenced blocks of a page run in order in a folder of its own, beside a copy of ``studies/``, with
the installed command and ``MCSETTLE_REALISATIONS``. In the page, a comment in the line above a block says

* ``<!-- before: COMMAND -->``: what the reader has done by then;
* ``<!-- exit code N -->``: the block shows what ends so;
* ``<!-- not run: REASON -->``: why no test runs it; ``<!-- left to studies/gallery.py: REASON -->``:
  that script runs it, no test.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import click
import pytest
import typer
from rich.markup import render

from mcsettle.cli.app import app
from mcsettle.cli.examples import EXAMPLES

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(sys.executable).parent
# Step A of sections, or many commands: .ci/run takes them, the fast suite does not.
SLOW = {
    "README.md",
    "docs/guide/calibrating.md",
    "docs/guide/line.md",
    "docs/guide/report.md",
    "docs/guide/running.md",
    "docs/guide/start.md",
    "docs/guide/tables.md",
    "docs/real-input.md",
    "studies/README.md",
}
PAGES = sorted(
    path.relative_to(ROOT).as_posix()
    for path in (ROOT / "README.md", *ROOT.glob("docs/**/*.md"), ROOT / "studies/README.md")
)
FENCE = re.compile(r"^```(console|python)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
COMMENT = re.compile(
    r"<!-- (before|exit code|not run|left to studies/gallery.py):? ?(.+?) -->\n*\Z"
)
HINT = re.compile(r"\b(?:Next|As a page|Every number): (mcsettle [^,\n]+)")
INLINE = re.compile(r"`(mcsettle [a-z][^`]*)`")
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")
EVERYWHERE = {"--help", "--quiet"}


@dataclass
class Block:
    """A fenced block: its commands or program, what comes before it, how it ends."""

    kind: str
    text: str
    before: list[str] = field(default_factory=list)
    exit_code: int = 0
    reason: str = ""  # why it is not run

    @property
    def commands(self) -> list[str]:
        """What a reader types: the lines after a prompt, with those that continue them."""
        commands: list[str] = []
        for line in self.text.splitlines():
            if line.startswith("$ "):
                commands.append(line[2:])
            elif commands and commands[-1].endswith("\\"):
                commands[-1] += f"\n{line}"
        return commands


def blocks(page: str) -> Iterator[Block]:
    """The blocks of a page in order, with what the comments above them say."""
    text = (ROOT / page).read_text(encoding="utf-8")
    for fence in FENCE.finditer(text):
        block, above = Block(fence[1], fence[2]), text[: fence.start()]
        while comment := COMMENT.search(above):
            above = above[: comment.start()]
            if comment[1] == "before":
                block.before.insert(0, comment[2])
            elif comment[1] == "exit code":
                block.exit_code = int(comment[2])
            else:
                block.reason = comment[2]
        yield block


class Reader:
    """Somebody who types what is printed, in a folder of their own; next steps once in a session."""

    hints: ClassVar[set[str]] = set()

    def __init__(self, folder: Path, cache: Path) -> None:
        self.folder, self.typed = folder, set[str]()
        shutil.copytree(
            ROOT / "studies", folder / "studies", ignore=shutil.ignore_patterns("*.pyc")
        )
        own = {"PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}", "MCSETTLE_CACHE": str(cache)}
        sample = {"MCSETTLE_REALISATIONS": "4", "OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": "agg"}
        self.environment = os.environ | own | sample

    def runs(self, command: str, exit_code: int = 0) -> None:
        """``command`` ends with ``exit_code``, and so do, with 0, the next steps that it prints."""
        if command in self.typed:
            return
        self.typed.add(command)
        done = subprocess.run(
            ["bash", "-c", command],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
        )
        said = f"$ {command}\n{done.stdout[-2000:]}{done.stderr[-2000:]}"
        assert done.returncode == exit_code, said
        assert "Traceback" not in done.stderr, said
        for hint in HINT.findall(done.stdout + done.stderr):
            verb = hint.split()[1]
            if verb not in self.hints:
                self.hints.add(verb)
                self.runs(hint.strip())

    def runs_program(self, program: str) -> None:
        """A Python program ends without an error, or a warning that nobody expects."""
        self.runs(f"{shlex.quote(sys.executable)} -c {shlex.quote(program)}")


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One cache for all pages and workers."""
    base = tmp_path_factory.getbasetemp()
    return (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "printed-cache"


@pytest.fixture
def reader(tmp_path: Path, cache: Path) -> Reader:
    return Reader(tmp_path, cache)


def with_blocks() -> list[object]:
    pages = [page for page in PAGES if any(not block.reason for block in blocks(page))]
    return [pytest.param(p, marks=[pytest.mark.slow] if p in SLOW else []) for p in pages]


@pytest.mark.parametrize("page", with_blocks())
def test_the_blocks_of_a_page_run_as_printed(page: str, reader: Reader) -> None:
    for block in blocks(page):
        if block.reason:
            continue
        for command in block.before:
            reader.runs(command)
        if block.kind == "python":
            reader.runs_program(block.text)
        for command in block.commands:
            reader.runs(command, block.exit_code)


@pytest.mark.parametrize("page", PAGES)
def test_a_console_block_has_commands(page: str) -> None:
    for block in blocks(page):
        assert block.kind == "python" or block.commands, block.text


@pytest.mark.slow
def test_the_examples_of_the_help_run_as_printed(reader: Reader) -> None:
    for example in EXAMPLES.values():
        reader.runs(example)


def verbs() -> dict[str, click.Command]:
    return typer.main.get_command(app).commands  # type: ignore[attr-defined]


def test_every_command_has_an_example_in_its_help() -> None:
    assert set(EXAMPLES) == set(verbs())
    for verb, command in verbs().items():
        assert f"mcsettle {verb}" in EXAMPLES[verb]
        assert f"Example: {EXAMPLES[verb]}" == render(str(command.epilog)).plain


@pytest.mark.parametrize("page", [*PAGES, "CONTRIBUTING.md"])
def test_commands_in_sentences_and_tables_have_options_and_studies_that_exist(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    for command in INLINE.findall(text):
        verb = command.split()[1]
        assert verb in verbs(), f"{page}: {command}"
        options = {o for p in verbs()[verb].params for o in p.opts} | EVERYWHERE
        assert set(OPTION.findall(command)) <= options, f"{page}: {command}"
        for study in re.findall(r"studies/\w+\.toml", command):
            assert (ROOT / study).is_file(), f"{page}: {command}"
