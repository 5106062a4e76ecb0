"""doctor and validate: what they print, what they return, what they say where something is wrong."""

import importlib.metadata
import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from mcsettle.cli import installation
from mcsettle.cli.app import app
from mcsettle.verification import run_cases
from mcsettle.verification.case import Case

runner = CliRunner()


def check(name: str) -> installation.Check:
    return next(c for c in installation.examine() if c.name == name)


def test_all_is_well_here(tmp_path: Path) -> None:
    """In a process of its own: nothing but the report on stdout, no banner anywhere."""
    program = "from mcsettle.cli.app import main; main()"
    environment = os.environ | {"MCSETTLE_CACHE": str(tmp_path), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", program, "doctor", "--json"],
        capture_output=True, text=True, check=False, env=environment,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    data = json.loads(done.stdout)
    assert data["passed"]
    assert {c["state"] for c in data["checks"]} == {"ok"}
    assert "Taichi]" not in done.stderr


def test_limits_are_those_of_the_project(root: Path) -> None:
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    first, below = installation.PYTHON_FROM, installation.PYTHON_BELOW
    span = f">={installation._dotted(first)},<{installation._dotted(below)}"
    assert project["requires-python"] == span
    assert f"taichi=={installation.TAICHI}" in project["dependencies"]
    wanted = {d.split(">")[0].split("=")[0] for d in project["dependencies"]}
    assert set(installation.LIBRARIES) == wanted
    for extra, library, version, _ in installation.EXTRAS:
        (needed,) = project["optional-dependencies"][extra]
        assert needed == f"{library}=={version}" if version else needed.startswith(f"{library}>=")


def test_extras_are_told_and_missing_ones_are_no_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    found = check("extras")
    assert found.state == "ok"
    assert f"distributed {importlib.metadata.version('distributed')}" in found.found
    kept = importlib.metadata.version

    def bare(name: str) -> str:
        if name == "distributed":
            raise importlib.metadata.PackageNotFoundError(name)
        return kept(name)

    monkeypatch.setattr(importlib.metadata, "version", bare)
    assert check("extras").state == "ok"
    assert "pip install 'mcsettle[distributed]' for run --scheduler" in check("extras").found
    monkeypatch.setattr(importlib.metadata, "version", lambda name: "0.1")
    assert check("extras").state == "note"
    assert "wants distributed" in check("extras").advice


def test_object_stores_of_this_pyarrow(monkeypatch: pytest.MonkeyPatch) -> None:
    from pyarrow import fs

    for name in installation.STORES.values():
        monkeypatch.setattr(fs, name, object, raising=False)
    assert check("object stores").found.startswith("s3:// yes, gs:// yes, abfs:// yes")
    monkeypatch.delattr(fs, "AzureFileSystem")
    assert "abfs:// no" in check("object stores").found
    assert check("object stores").state == "note"


def test_each_failure_says_what_to_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from mcsettle.kernels import smoke

    file = tmp_path / "file"
    file.write_text("x", encoding="utf-8")
    monkeypatch.setattr(installation.sys, "version_info", (3, 10, 0))
    monkeypatch.setattr(installation, "LIBRARIES", ("numpy", "no-such-library"))
    monkeypatch.setattr(smoke, "largest_error", lambda: 1e-7)  # single precision
    monkeypatch.setenv("MCSETTLE_CACHE", str(file / "below"))
    done = runner.invoke(app, ["doctor"])
    assert done.exit_code == 1
    for advice in ("3.11 or newer", "pip install no-such-library", "results would be wrong",
                   "set MCSETTLE_CACHE"):  # fmt: skip
        assert advice in done.stdout
    assert "checks failed" in done.stdout
    assert "Traceback" not in done.output


def test_taichi_that_does_not_load(monkeypatch: pytest.MonkeyPatch) -> None:
    from mcsettle.kernels import smoke

    def broken() -> float:
        raise OSError("libtaichi.so: cannot open shared object file")

    monkeypatch.setattr(smoke, "largest_error", broken)
    found = check("kernels")
    assert found.state == "failed"
    assert "taichi==" in found.advice


def test_full_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation.shutil, "disk_usage", lambda path: SimpleNamespace(free=10**6))
    assert check("disk").state == "failed"


def test_blas_threads_are_only_a_note(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation.os, "sched_getaffinity", lambda pid: {0, 1})
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    assert check("threads").state == "note"


def test_stale_cache(tmp_path: Path) -> None:
    from mcsettle.kernels import runtime

    current, old = tmp_path / runtime.cache_name(), tmp_path / f"{runtime.NAME}-1.0.3-0123456789ab"
    for folder in (current, old):
        folder.mkdir()
    half, table = tmp_path / ".transfer-x.npz.abc", tmp_path / "transfer-x.npz"
    for file in (half, table):
        file.write_bytes(b"x")
    written = half.stat().st_mtime
    assert installation.stale_files(tmp_path, written + 1.0) == [old]  # a writer may still be at it
    assert installation.stale_files(tmp_path, written + 2.0 * installation.LEFTOVER_AGE) == [
        old,
        half,
    ]


# --- validate -------------------------------------------------------------------------------------


@pytest.fixture
def cases(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two cases, the second one wrong."""
    made = {
        "good": lambda name: Case(name, "book", 2.0, 2.0 + 1e-3j, 1e-2, "m", 2.0),
        "bad": lambda name: Case(name, "book", 1.0, float("nan"), 1e-2, "m", 1.0),
    }
    monkeypatch.setattr(run_cases, "CASES", made)


@pytest.mark.usefixtures("cases")
def test_validate_prints_and_judges() -> None:
    done = runner.invoke(app, ["validate", "good"])
    assert done.exit_code == 0
    assert "1 of 1 cases within tolerance" in done.stdout
    assert "book" in done.stdout
    assert "Verification" in done.stderr
    assert "Verification" not in done.stdout
    done = runner.invoke(app, ["validate"])
    assert done.exit_code == 1
    assert "FAILED" in done.stdout
    done = runner.invoke(app, ["validate", "good", "godo"])
    assert done.exit_code == 2
    assert "godo: no such verification case; choose from good, bad" in done.stderr


@pytest.mark.usefixtures("cases")
def test_validate_json_has_no_nan() -> None:
    done = runner.invoke(app, ["validate", "--json"])
    assert done.exit_code == 1
    data = json.loads(done.stdout)
    assert [case["passed"] for case in data["cases"]] == [True, False]
    assert data["cases"][0]["obtained"] == [2.0, 1e-3]
    assert data["cases"][1]["obtained"] is None
    assert not data["passed"]
