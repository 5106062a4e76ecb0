"""The command line: results on stdout, talk on stderr, exit codes, no traceback for user input."""

import dataclasses
import io
import json
import os
import re
import signal
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from typer.testing import CliRunner

import mcsettle
from mcsettle.cli import terminal
from mcsettle.cli.app import app
from mcsettle.cli.observations import read_observations
from mcsettle.errors import InputError, NumericalError
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import Finished
from mcsettle.study.study import Study, load_study
from mcsettle.summary.answers import is_calibrated
from mcsettle.summary.results import read_results
from mcsettle.summary.summary import summary_rows
from mcsettle.types import Progress

runner = CliRunner()
ROOT = Path(__file__).resolve().parents[2]
STUDIES = ROOT / "studies"
TOY = str(STUDIES / "toy.toml")


def invoke(*arguments: str | Path) -> Any:
    return runner.invoke(app, [str(argument) for argument in arguments])


def command(*arguments: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command in a process of its own."""
    program = [sys.executable, "-c", "from mcsettle.cli.app import main; main()"]
    return subprocess.run(
        [*program, *map(str, arguments)], capture_output=True, text=True, cwd=cwd, check=False
    )


# --- help, version, progress ------------------------------------------------------------------------


def test_version_and_module_are_the_command() -> None:
    done = invoke("--version")
    assert (done.exit_code, done.stdout) == (0, f"mcsettle {mcsettle.__version__}\n")
    module = subprocess.run(
        [sys.executable, "-m", "mcsettle", "--version"], capture_output=True, text=True, check=True
    )
    assert module.stdout == done.stdout
    assert "--install-completion" in invoke("--help").stdout


def test_progress_is_one_line_a_stage_away_from_a_terminal(
    capsys: pytest.CaptureFixture[str],
) -> None:
    progress = terminal.Progress()
    for stage in ("Step A", "Step B"):
        for done in range(4):
            progress(stage, done, 3)
    progress("Pictures", 1, 9)
    progress("Tables", 1, 1)
    lines = re.sub(r"\d+ s", "0 s", capsys.readouterr().err).splitlines()
    assert lines == [
        "Step A: 3/3 (0 s)", "Step B: 3/3 (0 s)", "Pictures: 1/9 (0 s)", "Tables: 1/1 (0 s)",
    ]  # fmt: skip


def test_quiet_leaves_warnings_and_errors(tmp_path: Path, pipeline: SimpleNamespace) -> None:
    done = invoke("run", TOY, "--out", tmp_path, "--quiet")
    assert (done.exit_code, done.stderr) == (0, "remark: look here\n")
    assert "Next:" in invoke("run", TOY, "--out", tmp_path).stderr
    done = invoke("check", tmp_path / "none.toml", "-q")
    assert done.exit_code == 2
    assert "does not exist" in done.stderr


@pytest.mark.parametrize("colours", [True, False])
def test_a_bar_on_a_terminal_takes_no_colour_where_none_is_wanted(
    monkeypatch: pytest.MonkeyPatch, colours: bool
) -> None:
    screen = io.StringIO()
    screen.isatty = lambda: True  # type: ignore[method-assign]
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    if not colours:
        monkeypatch.setenv("NO_COLOR", "1")
    progress = terminal.Progress()
    progress("Step B", 1, 2)
    progress("Step B", 2, 2)
    assert "Step B" in screen.getvalue()
    assert "2/2" in screen.getvalue()
    assert ("\x1b[3" in screen.getvalue()) == colours


def test_parameters_of_the_model_are_options_on_the_terminal(tmp_path: Path) -> None:
    done = invoke("run", TOY, "--out", tmp_path / "out", "--until", "nonsense")
    assert 'mcsettle: --until received "nonsense"' in done.stderr
    assert "until=" not in done.stderr


# --- init, check, schema --------------------------------------------------------------------


def test_help_names_every_command() -> None:
    done = invoke("--help")
    assert done.exit_code == 0
    for verb in ("init", "check", "schema", "run", "plan", "summarise", "calibrate", "tornado",
                 "track", "profile", "life", "grounds", "validate", "doctor"):  # fmt: skip
        assert verb in done.stdout


def test_init_writes_a_sound_study_and_never_overwrites(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    assert invoke("init", path).exit_code == 0
    text = path.read_text(encoding="utf-8")
    assert load_study(path).scenario_names == ("v201", "v225")
    path.write_text("mine", encoding="utf-8")
    again = invoke("init", path)
    assert again.exit_code == 2
    assert "exists" in again.stderr
    assert path.read_text(encoding="utf-8") == "mine"
    # Its commented-out keys exist too: with the comment signs taken off it is still sound.
    lines = [line.removeprefix("# ") if " = " in line or "[" in line else line
             for line in text.splitlines()]  # fmt: skip
    bold = "\n".join(line for line in lines if "model = " not in line or '"beam" #' in line)
    tomllib.loads(bold)


def test_the_study_that_init_writes_is_calibrated(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    assert invoke("init", path).exit_code == 0
    checked = invoke("check", path)
    assert "warning" not in checked.stderr, "the factor is of another ground"
    assert is_calibrated(load_study(path), "base")
    assert load_study(path).calibration is not None
    assert invoke("run", path, "--realisations", 16, "--out", tmp_path / "out").exit_code == 0
    for done in (checked, *(invoke("summarise", tmp_path / "out", *a) for a in ((), ("--all",)))):
        assert "stresses are those of a uniform half-space" in " ".join(done.stdout.split())
    rows = summary_rows(read_results(tmp_path / "out"))
    medians = {(row.scenario, row.metric): row.at(0.5).value for row in rows}
    assert medians["v201", "tamping_interval_days"] == pytest.approx(697, rel=0.15)
    assert medians["v225", "marginal_cost"] is not None


@pytest.mark.parametrize("name", sorted(path.stem for path in STUDIES.glob("*.toml")))
def test_every_example_is_written_with_its_data(name: str, tmp_path: Path) -> None:
    done = invoke("init", "--example", name, tmp_path / "mine.toml")
    assert done.exit_code == 0, done.stderr
    assert invoke("check", tmp_path / "mine.toml").exit_code == 0
    assert load_study(tmp_path / "mine.toml").digest == load_study(STUDIES / f"{name}.toml").digest


def test_examples_are_listed_by_their_titles(tmp_path: Path) -> None:
    listed = invoke("init", "--list").stdout.splitlines()
    assert [line.split()[0] for line in listed] == sorted(p.stem for p in STUDIES.glob("*.toml"))
    assert all(len(line.split()) > 3 for line in listed)
    done = invoke("init", "--list", tmp_path / "study.toml")
    assert done.exit_code == 2
    assert "leave out FILE" in done.stderr
    unknown = invoke("init", "--example", "lines", tmp_path / "study.toml")
    assert unknown.exit_code == 2
    assert '"lines"' in unknown.stderr
    assert "linespeed" in unknown.stderr
    assert not list(tmp_path.iterdir())


def test_an_example_overwrites_no_data(tmp_path: Path) -> None:
    (tmp_path / "line_sds.csv").write_text("mine", encoding="utf-8")
    done = invoke("init", "--example", "line", tmp_path / "mine.toml")
    assert done.exit_code == 2
    assert "line_sds.csv exists" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["line_sds.csv"]
    (tmp_path / "line_sds.csv").write_bytes((STUDIES / "line_sds.csv").read_bytes())
    assert invoke("init", "--example", "line", tmp_path / "mine.toml").exit_code == 0


def test_init_into_a_missing_folder(tmp_path: Path) -> None:
    done = invoke("init", tmp_path / "none" / "study.toml")
    assert done.exit_code == 2
    assert "cannot be written" in done.stderr


def test_check_describes_a_sound_study() -> None:
    done = invoke("check", TOY)
    assert done.exit_code == 0
    assert load_study(TOY).digest in done.stdout
    assert "72 × passenger at 201 km/h" in done.stdout


def test_check_resolved_prints_the_whole_study() -> None:
    done = invoke("check", TOY, "--resolved")
    assert Study.from_mapping(tomllib.loads(done.stdout)) == load_study(TOY)


def test_check_warns_on_stderr(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    text = Path(TOY).read_text(encoding="utf-8").replace('"beam"', '"section"')
    path.write_text(text.replace("225", "330"), encoding="utf-8")
    done = invoke("check", path)
    assert done.exit_code == 0
    assert "warning: scenarios[2].timetable[1].speed_kmh" in done.stderr
    assert "warning" not in done.stdout


def test_schema_is_json() -> None:
    assert json.loads(invoke("schema").stdout)["title"] == "Study"


# --- bad input ------------------------------------------------------------------------------------


@pytest.mark.parametrize("verb", ["check", "run", "track", "calibrate"])
@pytest.mark.parametrize(
    ("content", "told"),
    [(None, "does not exist"), ("a = ", "not valid TOML"), ("seed = 1\nsed = 2", "did you mean")],
    ids=["missing", "syntax", "unknown key"],
)
def test_bad_study_is_told_in_words(
    tmp_path: Path, verb: str, content: str | None, told: str
) -> None:
    path, out = tmp_path / "study.toml", tmp_path / "out"
    if content is not None:
        path.write_text(content, encoding="utf-8")
    more = {"run": ["--out", out], "calibrate": ["--scenario", "x", "--median-days", "9"]}
    done = invoke(verb, path, *more.get(verb, []))
    assert done.exit_code == 2
    assert told in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    assert not out.exists()


@pytest.mark.parametrize("option", ["--realisations", "--threads", "--batch"])
def test_run_refuses_counts_below_one(tmp_path: Path, option: str) -> None:
    done = invoke("run", TOY, "--out", tmp_path / "out", option, "0")
    assert done.exit_code == 2
    assert not (tmp_path / "out").exists()


def test_run_into_a_file_or_below_one(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("x", encoding="utf-8")
    for out in (file, file / "below"):
        done = invoke("run", TOY, "--out", out)
        assert done.exit_code == 2
        assert "is a file; name a folder" in done.stderr
    assert file.read_text(encoding="utf-8") == "x"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_run_into_an_unwritable_folder(tmp_path: Path) -> None:
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o500)
    done = invoke("run", TOY, "--out", locked / "out")
    assert done.exit_code == 2
    assert "no permission" in done.stderr


def test_unwritable_folder_is_refused_before_any_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: not mode & os.W_OK)
    done = invoke("run", TOY, "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert "no permission" in done.stderr


def test_calibrate_checks_names_and_days_before_any_work() -> None:
    done = invoke("calibrate", TOY, "--scenario", "v20", "--median-days", "697")
    assert done.exit_code == 2
    assert "is no scenario of this study" in done.stderr
    done = invoke("calibrate", TOY, "--scenario", "v201", "--median-days", "nan")
    assert done.exit_code == 2
    assert "--median-days is nan" in done.stderr
    done = invoke("calibrate", TOY, "--scenario", "v201", "--median-days", "9", "--variant", "bse")
    assert "did you mean 'base'?" in done.stderr


# --- run, calibrate: what is called and what is said ---------------------------------------


@pytest.fixture
def pipeline(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The chain replaced by one that records how it is called."""
    calls = SimpleNamespace(run=None, failure=None, n_failed=0)

    def run_study(study: Study, out: Path, options: RunOptions, progress: Progress) -> Finished:
        if calls.failure is not None:
            raise calls.failure
        calls.run = (study, out, options, progress)
        return Finished(out, calls.n_failed, ("look here",))

    monkeypatch.setattr("mcsettle.run.pipeline.run_study", run_study)
    return calls


def test_run_hands_its_options_on(tmp_path: Path, pipeline: SimpleNamespace) -> None:
    done = invoke(
        *("run", TOY, "--out", tmp_path, "--realisations", 5, "--seed", 3),
        *("--threads", 2, "--batch", 4, "--exact"),
    )
    assert done.exit_code == 0
    study, out, options, progress = pipeline.run
    assert study == load_study(TOY)
    assert out == tmp_path
    assert progress is not None
    assert options.processes >= 1
    expected = RunOptions(realisations=5, seed=3, threads=2, batch=4, exact=True)
    assert dataclasses.replace(options, processes=expected.processes) == expected
    assert done.stdout == ""
    assert "look here" in done.stderr
    assert "mcsettle summarise" in done.stderr


def test_exit_codes(tmp_path: Path, pipeline: SimpleNamespace) -> None:
    pipeline.n_failed = 2
    done = invoke("run", TOY, "--out", tmp_path)
    assert done.exit_code == 3
    assert "2 realisations failed" in done.stderr
    for failure, code in (
        (InputError("the folder holds another study"), 2),
        (PermissionError(13, "Permission denied", "x"), 2),
        (NumericalError("the table did not converge"), 1),
        (KeyboardInterrupt(), 130),
    ):
        pipeline.failure = failure
        done = invoke("run", TOY, "--out", tmp_path)
        assert done.exit_code == code, failure
        assert "Traceback" not in done.output


def test_calibrate_prints_the_factor(monkeypatch: pytest.MonkeyPatch) -> None:
    from dataclasses import make_dataclass

    found = make_dataclass("Found", ["scenario", "factor", "realisations", "factor_digest"])(
        "v201", 31.25, 32, "0123456789abcdef"
    )

    def calibrate(study: Study, scenario: str, days: float, **options: Any) -> Any:
        assert (scenario, days, options["variant"]) == ("v201", 697.0, None)
        return found

    monkeypatch.setitem(
        sys.modules, "mcsettle.analysis.calibration", SimpleNamespace(calibrate=calibrate)
    )
    done = invoke("calibrate", TOY, "--scenario", "v201", "--median-days", "697")
    assert done.exit_code == 0
    lines = done.stdout.splitlines()
    assert lines[0] == "settlement_factor = 31.25"
    assert tomllib.loads(done.stdout) == {
        "settlement_factor": 31.25,
        "factor_digest": "0123456789abcdef",
    }
    assert "# realisations: 32" in lines


def test_calibrate_wants_one_target() -> None:
    for more in ((), ("--median-days", "9", "--observations", "0:1:1")):
        done = invoke("calibrate", TOY, "--scenario", "v201", *more)
        assert done.exit_code == 2
        assert "either --median-days or --observations" in done.stderr
    done = invoke("calibrate", TOY, "--scenario", "v201", "--observations", "none.csv")
    assert done.exit_code == 2
    assert "cannot be read" in done.stderr


def test_a_posterior_is_printed_as_toml_to_paste(monkeypatch: pytest.MonkeyPatch) -> None:
    from mcsettle.analysis import posterior

    rows = read_observations("0:1.03:0.05,365:1.2:0.05")
    found = posterior.Posterior(
        "v201", "base", rows, 21.0, (15.0, 20.0, 27.0), 20.2, 0.18, 7.5, 4.0, 64, 1
    )
    monkeypatch.setattr(posterior, "infer_factor", lambda *_, **__: found)
    done = invoke(
        *("calibrate", TOY, "--scenario", "v201", "--observations", "0:1.03:0.05,365:1.2:0.05")
    )
    assert done.exit_code == 0
    assert done.stderr.count("warning") == 2  # few tracks carry it, and none fits
    pasted = tomllib.loads(done.stdout)
    data = tomllib.loads(Path(TOY).read_text(encoding="utf-8"))
    data["settlement"] |= pasted["settlement"]
    study = Study.from_mapping(data | {"uncertain": pasted["uncertain"]})
    assert study.uncertain[0].built().quantile(0.5) == pytest.approx(20.2)
    assert "2 observed SDs" in study.uncertain[0].source


@pytest.mark.parametrize(
    ("met", "late", "until", "code", "said"),
    [
        (True, False, "tamping_interval median 2%", 0, "Target met"),
        (False, False, "tamping_interval median 2%", 5, "missed at the cap"),
        (False, True, "tamping_interval median 2%", 5, "Stopped for time"),
        (False, True, None, 0, "Stopped for time"),
    ],
)
def test_run_until(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    met: bool,
    late: bool,
    until: str | None,
    code: int,
    said: str,
) -> None:
    from mcsettle.cli import until as batches
    from mcsettle.run.stopping import Batch, Stopped

    def run_until(
        study: Study,
        out: Path,
        target: Any,
        minutes: float,
        options: RunOptions,
        *_: Any,
        **sinks: Any,
    ) -> Stopped:
        assert (options.realisations, minutes) == (500, 3.0)
        batch = Batch(64, None if target is None else 0.013, "base v201", 1.5)
        sinks["tell"](batch)
        return Stopped(Finished(out, 0, ()), (batch,), met, late)

    monkeypatch.setattr(batches, "run_until", run_until)
    more = () if until is None else ("--until", until)
    done = invoke(
        *("run", TOY, "--out", tmp_path, "--realisations", 500, "--max-minutes", 3, *more)
    )
    assert done.exit_code == code
    assert said in done.stderr
    assert "64 realisations" in done.stdout
    assert ("1.30 %" in done.stdout) == (until is not None)


def test_run_until_nonsense(tmp_path: Path) -> None:
    done = invoke("run", TOY, "--out", tmp_path / "out", "--until", "better")
    assert done.exit_code == 2
    assert "METRIC STATISTIC PERCENT" in done.stderr
    assert not (tmp_path / "out").exists()


def test_tornado_prints_bars(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from mcsettle.analysis import tornado

    done = invoke("tornado", TOY)
    assert done.exit_code == 2
    assert "no [[uncertain]] inputs" in done.stderr
    entry = '[[uncertain]]\ninput = "limit.sd_limit_mm"\ndistribution = "uniform"\n'
    path = tmp_path / "study.toml"
    text = Path(TOY).read_text(encoding="utf-8") + f"\n{entry}low = 1.4\nhigh = 1.6\n"
    path.write_text(text, encoding="utf-8")
    bar = tornado.Bar("v201", "tamping_interval_days", "d", "limit.sd_limit_mm", 1.42, 1.58,
                      600.0, None, 697.0)  # fmt: skip
    monkeypatch.setattr(tornado, "tornado", lambda *_: [bar])
    done = invoke("tornado", path)
    assert done.exit_code == 0
    for part in ("limit.sd_limit_mm", "1.42", "600", "697", "–"):
        assert part in done.stdout
    assert json.loads(invoke("tornado", path, "--json").stdout)[0]["at_high"] is None


# --- summarise ------------------------------------------------------------------------------------


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """A small finished run, written by hand: 20 tracks, two of them censored at 225 km/h."""
    import numpy as np

    from mcsettle.storage import store
    from mcsettle.storage.files import write_file
    from mcsettle.storage.provenance import Provenance
    from mcsettle.storage.shard_name import shard_name
    from mcsettle.study.study import resolved_toml

    reference = {"metric": "tamping_interval_days", "scenario": "v201", "value": 697.0}
    data = tomllib.loads(Path(TOY).read_text(encoding="utf-8"))
    data["reference"] = [reference | {"unit": "d", "source": "Table 3"}]
    study = Study.from_mapping(data)
    folder = tmp_path / "run"
    provenance = Provenance("0", study.digest, "0", 1, "0", "f64", 1)
    store.prepare(folder, provenance)
    write_file(folder / "study.toml", resolved_toml(study).encode())
    n = 20
    days = {"v201": np.linspace(500.0, 880.0, n), "v225": np.linspace(400.0, 780.0, n)}
    days["v225"][-2:] = np.nan
    growth_of = {"v201": [0.31] * 3, "v225": [None] * 3}
    for scenario, interval in days.items():
        name = shard_name("base", scenario, 0, n - 1)
        keys = {"variant": ["base"] * n, "scenario": [scenario] * n}
        keys |= {"parameter_set": np.zeros(n, np.int32), "realisation": np.arange(n)}
        known = [None if np.isnan(d) else float(d) for d in interval]
        rows = keys | {
            "status": ["censored" if d is None else "reached" for d in known],
            "tamping_interval_days": known,
            "censored_at_days": [18250.0 if d is None else None for d in known],
            "passages": np.full(n, 1000),
            "tonnage_mgt": np.ones(n),
            "sd_initial_mm": np.full(n, 1.03),
            "sd_final_mm": np.full(n, 1.5),
            "mean_settlement_mm": np.ones(n),
            # The last three tracks of 225 km/h reach the limit within the year.
            "sd_growth_1y_mm": [*np.linspace(0.2, 0.3, n - 3), *growth_of[scenario]],
            "failure": [None] * n,
        }
        store.write(folder, "realisations", name, rows, provenance)
        early = {"day": np.zeros(n), "sd_mm": np.full(n, 1.03)}
        store.write(folder, "history", name, keys | early, provenance)
        later = {"day": np.full(n, 697.0), "sd_mm": np.linspace(1.4, 1.49, n)}
        name = shard_name("base", scenario, n, 2 * n - 1)
        store.write(folder, "history", name, keys | later, provenance)
    paired = [i < n - 2 for i in range(n)]
    effects = keys | {
        "baseline": ["v201"] * n,
        "status": ["paired" if p else "censored" for p in paired],
        "effect": ["speed"] * n,
        "reduction_percent": [10.0 + i if p else None for i, p in enumerate(paired)],
        "elasticity": [-2.0 if p else None for p in paired],
        "marginal_cost": [1.4 if p else None for p in paired],
    }
    store.write(folder, "effects", shard_name("base", "v225", 0, n - 1), effects, provenance)
    store.finish(folder)
    return folder


def test_summarise_prints_scenarios_beside_published_values(
    results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mcsettle.cli.tables.WIDTH", 200)  # every column has its place
    done = invoke("summarise", results, "--all")
    assert done.exit_code == 0, done.output
    for part in ("v201", "v225", "tamping_interval_days", "elasticity", "697", "Table 3", "690"):
        assert part in done.stdout
    for part in ("Mean over a line", "100 km", "pairing gain", "cost at mean"):
        assert part in done.stdout
    assert done.stderr == ""


def test_summarise_json_holds_errors_and_counts(results: Path) -> None:
    data = json.loads(invoke("summarise", results, "--json").stdout)
    rows = {(row["scenario"], row["metric"]): row for row in data["rows"]}
    base = rows["v201", "tamping_interval_days"]
    median = next(s for s in base["statistics"] if s["level"] == 0.5)
    assert median["value"] == pytest.approx(690.0, rel=1e-12)  # the middle of 500 … 880
    assert median["standard_error"] > 0
    assert base["reference"]["value"] == 697.0
    assert base["reference_percent"] == 50.0  # 500, 520, … 680 lie below 697
    fast = rows["v225", "tamping_interval_days"]["statistics"][0]
    assert fast["n_censored"] == 2
    # Growth is censored where the limit came first: at its 0.47 mm, above the largest growth seen.
    year = {s["level"]: s for s in rows["v225", "sd_growth_1y_mm"]["statistics"]}
    assert year[0.5]["n_censored"] == 3
    assert 0.2 < year[0.5]["value"] < 0.3
    assert year[0.95]["value"] is None
    assert year[0.95]["note"] == "the limit comes first"
    # SD growth by the published day: from 1.03 to the middle of 1.40 … 1.49 mm.
    growth = next(s for s in rows["v201", "sd_growth_697d_mm"]["statistics"] if s["level"] == 0.5)
    assert growth["value"] == pytest.approx(1.445 - 1.03, rel=1e-9)
    spread = {(s["statistic"], s["subject"], s["level"]) for s in base["spread"]}
    assert ("line_mean", "10 km", 0.5) in spread
    assert rows["v225", "marginal_cost"]["unit"] == "GBP per km/h per 1000 train-km"
    assert {"variant": "base", "scenario": "v225", "status": "censored", "n": 2} in data["counts"]


def test_summarise_draws_a_picture(results: Path, tmp_path: Path) -> None:
    picture = tmp_path / "pictures" / "run.png"
    assert invoke("summarise", results, "--picture", picture).exit_code == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    done = invoke("summarise", results, "--picture", tmp_path / "run.xyz")
    assert done.exit_code == 2
    assert ".png" in done.stderr


def test_summarise_of_nothing(tmp_path: Path) -> None:
    for folder in (tmp_path / "none", tmp_path):
        done = invoke("summarise", folder)
        assert done.exit_code == 2
        assert "mcsettle run STUDY" in done.stderr
        assert "Traceback" not in done.stderr


# --- real processes -------------------------------------------------------------------------------


def test_command_in_an_empty_folder(tmp_path: Path) -> None:
    assert command("init", cwd=tmp_path).returncode == 0
    done = command("check", "study.toml", cwd=tmp_path)
    assert done.returncode == 0
    assert "sound" in done.stdout
    bad = command("check", "no.toml", cwd=tmp_path)
    assert bad.returncode == 2
    assert bad.stdout == ""
    assert bad.stderr == "mcsettle: no.toml does not exist; 'mcsettle init' writes a study\n"


def test_a_folder_that_has_gone_is_said(tmp_path: Path) -> None:
    study = ROOT / "studies" / "toy.toml"
    program = (
        "import os, sys; os.rmdir(os.getcwd()); from mcsettle.cli.app import main; "
        f"sys.argv[1:] = ['run', {str(study)!r}, '--out', 'r']; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, cwd=tmp_path, check=False
    )
    assert done.returncode == 2
    assert "the folder that this command was started in has been removed" in done.stderr


def test_usage_error_is_exit_2() -> None:
    done = command("run", TOY)
    assert done.returncode == 2
    assert "--out" in done.stderr
    assert "Traceback" not in done.stderr


def test_closed_pipe_is_quiet() -> None:
    code = "import sys; sys.stdin.read(); from mcsettle.cli.app import main; main()"
    program = [sys.executable, "-u", "-c", code, "schema"]
    pipe = subprocess.PIPE
    with subprocess.Popen(program, stdin=pipe, stdout=pipe, stderr=pipe, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()  # nobody reads any more, before a word is written
        process.stdin.close()
        assert process.stderr.read() == ""


def test_interrupt_is_130(tmp_path: Path) -> None:
    code = (
        "import sys, types, os, signal, time\n"
        "fake = types.ModuleType('mcsettle.run.pipeline')\n"
        "def run_study(*a, **k):\n"
        "    os.kill(os.getpid(), signal.SIGINT); time.sleep(30)\n"
        "fake.run_study = run_study\n"
        "sys.modules['mcsettle.run.pipeline'] = fake\n"
        "from mcsettle.cli.app import main; main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "run", TOY, "--out", str(tmp_path / "out")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode in (130, -signal.SIGINT)
    assert "Interrupted" in done.stderr
    assert "Traceback" not in done.stderr


def test_several_studies_run_into_folders_of_their_names(tmp_path):
    for name in ("one", "two"):
        (tmp_path / f"{name}.toml").write_text(Path(TOY).read_text())
    files = [tmp_path / "one.toml", tmp_path / "two.toml"]
    done = invoke("run", *files, "--out", tmp_path / "both", "--realisations", 8)
    assert done.exit_code == 0, done.output
    kept = [(tmp_path / "both" / n / "manifest.json").exists() for n in ("one", "two")]
    assert kept == [True, True]


def test_studies_of_one_name_are_refused_together(tmp_path):
    done = invoke("run", TOY, TOY, "--out", tmp_path / "both")
    assert done.exit_code == 2
    assert "toy: several study files of this name" in done.output
    assert not (tmp_path / "both").exists()


def test_help_shows_the_tables_that_an_example_names() -> None:
    shown = CliRunner().invoke(app, ["life", "--help"]).output
    assert "[maintenance]" in shown
