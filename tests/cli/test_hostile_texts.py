"""A study, lock or folder of somebody else's is printed, and obeyed nowhere; odd streams are borne."""

import io
import json
import subprocess
import sys
from dataclasses import asdict, replace

import made_run
import pytest
from typer.testing import CliRunner

from mcsettle.cli import terminal
from mcsettle.cli.app import app
from mcsettle.cli.tables import console, table
from mcsettle.run import status
from mcsettle.run.options import RunOptions
from mcsettle.storage import lock
from mcsettle.study.study import resolved_toml, study_from_text

ESC = "\x1b]52;c;aGk=\x07\x1b[2J\x9b5m\u202e"
TITLES = ["factor [mm]", "[/]", "[red]", ESC, "a\n# b", ":smile:"]
DAYS = {"v201": [400.0, 500.0, 600.0], "v225": [300.0, 400.0, 500.0]}


def invoke(*arguments):
    done = CliRunner().invoke(app, [str(a) for a in arguments])
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return done


def is_obeyed_nowhere(text: str) -> bool:
    return not any(sign in text for sign in ("\x1b", "\x07", "\x9b", "\u202e"))


@pytest.fixture(params=range(len(TITLES)))
def titled(request, tmp_path):
    """A finished run of a study with this title, its variant's and scenarios' too."""
    title = TITLES[request.param]
    given = [s.model_dump(exclude_none=True) | {"title": title} for s in made_run.study().scenarios]
    variants = [
        v.model_dump(exclude_none=True) | {"title": title} for v in made_run.study().variants
    ]
    study = made_run.study(title=title, scenarios=given, variants=variants)
    return title, study, made_run.write(tmp_path / "run", study, DAYS)


def test_titles_are_shown_as_they_are_and_obeyed_nowhere(titled, tmp_path):
    title, study, folder = titled
    path = tmp_path / "study.toml"
    path.write_text(resolved_toml(study), encoding="utf-8")
    shown = " ".join(title.split()) if title != ESC else "]52;c;aGk="
    for arguments in (
        ("check", path),
        ("check", path, "--resolved"),
        ("summarise", folder),
        ("summarise", folder, "--all"),
        ("summarise", folder, "--json"),
        ("compare", folder, folder),
    ):
        done = invoke(*arguments)
        assert done.exit_code == 0, (arguments, done.stderr)
        assert is_obeyed_nowhere(done.stdout + done.stderr), arguments
        if arguments[0] == "summarise" and "--json" not in arguments:
            assert shown in " ".join(done.stdout.split()), arguments
        if "--json" in arguments:
            json.loads(done.stdout)
        if "--resolved" in arguments:
            assert study_from_text(done.stdout.encode(), "again").title == title


def test_a_table_is_no_markup(capsys):
    made = table("a [/] [mm]", "name [b]")
    made.add_row(f"[link=x]y[/link] {ESC}")
    console().print(made)
    told = capsys.readouterr().out
    assert "a [/] [mm]" in told
    assert "[link=x]y[/link]" in told
    assert is_obeyed_nowhere(told)


def test_the_host_of_a_lock_is_obeyed_nowhere(tmp_path, monkeypatch):
    folder = made_run.write(tmp_path / "run", made_run.study(), DAYS)
    monkeypatch.setattr(status.mcsettle, "__version__", "0")  # made_run's
    other = replace(lock.myself("run"), host=f"h{ESC}", started=ESC)
    path = folder / lock.LOCKS / "h-1-00000000.json"
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(asdict(other)), encoding="utf-8")
    for arguments in (("status", folder), ("status", folder, "--json"), ("gather", folder)):
        done = invoke(*arguments)
        assert "at_work" in done.stdout or "process" in done.stdout + done.stderr
        assert is_obeyed_nowhere(done.stdout + done.stderr)


# --- streams --------------------------------------------------------------------------------------


@pytest.mark.parametrize("charset", ["ascii", "latin-1"])
def test_a_small_character_set_is_borne(monkeypatch, charset):
    sink = io.TextIOWrapper(io.BytesIO(), encoding=charset)
    monkeypatch.setattr(sys, "stdout", sink)
    terminal.prepare_streams()
    terminal.say("déjà – vu")
    terminal.say(json.dumps({"a": "–é"}, ensure_ascii=False), is_data=True)
    console().print("– é")
    sink.flush()
    first, second, _ = sink.buffer.getvalue().decode(charset, "replace").splitlines()
    assert "vu" in first
    assert json.loads(second) == {"a": "–é"}


def test_closed_streams_are_borne(monkeypatch):
    for name in ("stdout", "stderr"):
        monkeypatch.setattr(sys, name, None)
    terminal.prepare_streams()
    terminal.say("x")
    terminal.warn("y")
    sys.stdout.close()
    sys.stderr.close()


SCARCE = [
    MemoryError(),
    RuntimeError(
        "[host_memory_pool.cpp:allocate_raw_memory@62] Virtual memory allocation (1 B) failed."
    ),
    RuntimeError("Resource temporarily unavailable"),  # of a thread
]


@pytest.mark.parametrize("error", SCARCE)
def test_memory_that_does_not_suffice_is_said(monkeypatch, toy_path, error):
    from mcsettle.study import study

    def scarce(_):
        raise error

    monkeypatch.setattr(study, "load_study", scarce)
    done = invoke("check", toy_path)
    assert done.exit_code == terminal.FAILED
    assert "memory that this process may use does not suffice" in done.stderr


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no limit of the address space")
@pytest.mark.parametrize("gigabytes", [0.8, 1.25, 1.75, 2.5])
def test_an_address_space_that_does_not_suffice_is_said(tmp_path, toy_path, gigabytes):
    import resource

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (int(gigabytes * 1e9),) * 2)

    for arguments in (["check", toy_path], ["run", toy_path, "--out", tmp_path / "run"]):
        done = subprocess.run(
            [sys.executable, "-m", "mcsettle", *map(str, arguments)],
            preexec_fn=limited,
            capture_output=True,
            text=True,
        )
        assert "Traceback" not in done.stderr
        assert done.returncode == 0 or "memory" in done.stderr


@pytest.mark.parametrize(
    "options", [{"threads": 99_999_999_999}, {"shard_size": 10**20}, {"threads": 0}, {"batch": -1}]
)
def test_numbers_beyond_reason_are_refused_before_any_work(options):
    with pytest.raises(ValueError, match=rf"{next(iter(options))} is .*; it takes 1 to"):
        RunOptions(**options)
