"""Editors complete and check studies: the schema is one that a TOML server takes (taplo)."""

import os
import shutil
import subprocess
import sys
from importlib.metadata import distribution
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mcsettle.cli.app import app
from mcsettle.cli.init import SCHEMA, example_names

ROOT = Path(__file__).resolve().parents[2]
STUDIES = [*sorted((ROOT / "studies").glob("*.toml")), ROOT / "cli" / "template.toml"]
DIRECTIVE = f"#:schema {SCHEMA}\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the schema, as ``init`` leaves it."""
    done = CliRunner().invoke(app, ["init", str(tmp_path / "study.toml")])
    assert done.exit_code == 0, done.output
    return tmp_path


def linted(folder: Path) -> subprocess.CompletedProcess[str]:
    # In the environment's folder of commands, or beside the packages (pip install --target).
    places = [Path(sys.executable).parent, distribution("taplo").locate_file("bin")]
    taplo = shutil.which("taplo", path=os.pathsep.join(map(str, places)))
    assert taplo, f"no taplo in {places}"
    studies = sorted(path.name for path in folder.glob("*.toml"))
    return subprocess.run(
        [taplo, "lint", *studies], cwd=folder, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_the_first_line_of_a_study_names_the_schema(path: Path) -> None:
    assert path.read_text(encoding="utf-8").startswith(DIRECTIVE)


def test_a_toml_server_takes_the_schema_and_every_study(folder: Path) -> None:
    for path in STUDIES:
        (folder / path.name).write_bytes(path.read_bytes())
    done = linted(folder)
    assert done.returncode == 0, done.stderr


def test_a_toml_server_points_at_a_fault(folder: Path) -> None:
    study = folder / "study.toml"
    study.write_text(study.read_text(encoding="utf-8").replace("seed = 1", 'seed = "x"', 1))
    done = linted(folder)
    assert done.returncode != 0
    assert "seed" in done.stderr
    assert "is not" in done.stderr


def test_names_of_examples_are_completed() -> None:
    assert example_names("toy") == ["toy", "toy_uncertain"]
    assert example_names("x") == []


def test_a_schema_that_is_there_stays(tmp_path: Path) -> None:
    (tmp_path / SCHEMA).write_text("{}")
    done = CliRunner().invoke(app, ["init", str(tmp_path / "study.toml")])
    assert done.exit_code == 0
    assert (tmp_path / SCHEMA).read_text() == "{}"
