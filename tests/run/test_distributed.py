"""A run by Dask workers that are threads of this process: the same bytes, whatever fails on the way."""

import contextlib
import re
import subprocess
from pathlib import Path

import pytest
import toy
import toy_grounds
from toy import everything
from typer.testing import CliRunner

from mcsettle.cli.app import app
from mcsettle.errors import InputError
from mcsettle.run import compute, dispatch, factor_fit, worker
from mcsettle.run import distributed as cluster
from mcsettle.run.close import gather
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study
from mcsettle.run.shards import Slice
from mcsettle.run.status import survey
from mcsettle.study.study import resolved_toml

distributed = pytest.importorskip("distributed")
pytestmark = [
    pytest.mark.usefixtures("fresh_cache", "few_resamples"),
    pytest.mark.filterwarnings("ignore"),  # Dask's own, of every kind
]
N, SIZE = 6, 2


@pytest.fixture(scope="module")
def here():
    """A scheduler and two workers that are threads of this process."""
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None,
    ) as found:  # fmt: skip
        yield found.scheduler_address


@pytest.fixture
def in_process(here, monkeypatch):
    """``local`` is the cluster of this process, whose kernels stay where they are."""
    monkeypatch.setattr(worker, "_own_kernels", lambda: None)
    monkeypatch.setattr(worker, "_state", None)
    monkeypatch.setattr(cluster, "_ADDRESS", re.compile(r"inproc://.*"))
    monkeypatch.setattr(cluster, "workers", lambda *_: contextlib.nullcontext((here, None)))


@pytest.mark.parametrize(
    "text", ["", "local:0", "local:x", "host:8786", "tcp://host", "http://a:1"]
)
def test_scheduler_is_local_or_an_address(text):
    with pytest.raises(InputError, match="scheduler= received"):
        cluster.parse_scheduler(text)


def test_workers_write_the_same_bytes(study, whole, tmp_path, in_process):
    done = cluster.run_distributed(study, tmp_path, "local", RunOptions(shard_size=SIZE))
    assert (done.n_shards, done.n_computed, done.n_failed) == (6, 6, 0)
    assert everything_but_step_a(tmp_path) == everything(whole)
    again = cluster.run_distributed(study, tmp_path, "local")
    assert again.n_computed == 0


def everything_but_step_a(folder: Path) -> dict[str, bytes]:
    return {k: v for k, v in everything(folder).items() if not k.startswith(worker.STEP_A)}


def test_a_poisoned_shard_becomes_failed_rows_and_heals(
    study, whole, tmp_path, in_process, monkeypatch
):
    """One shard fails every time: its rows say why, exit code 3; the next run tries it once more."""
    kept, asked = worker.compute.write_computed, []

    def poisoned(job, member, scene, engine, shard):
        asked.append(shard.name)
        if "v225--00000002" in shard.name:
            raise FloatingPointError("poison")
        kept(job, member, scene, engine, shard)

    monkeypatch.setattr(worker.compute, "write_computed", poisoned)
    path = tmp_path / "study.toml"
    path.write_text(resolved_toml(study), encoding="utf-8")
    out = tmp_path / "out"
    done = CliRunner().invoke(
        app,
        ["run", str(path), "--out", str(out), "--scheduler", "local", "--shard-size", str(SIZE)],
    )
    assert done.exit_code == 3, done.stderr
    assert "FloatingPointError: poison" in done.stderr
    bad = "base--v225--00000002-00000003.parquet"
    assert asked.count(bad) == 1 + dispatch.RETRIES
    found = survey(out)
    assert [(fault.shard, fault.state) for fault in found.faults] == [(bad, "failed")]
    assert gather(out).n_failed == 0  # of the whole shards
    rows = toy.table(out, "realisations")
    failed = rows[rows["status"] == "failed"]
    assert failed["realisation"].tolist() == [2, 3]
    assert failed["failure"].str.contains("poison").all()
    assert (failed["sd_initial_mm"].round(9) == 1.03).all()
    monkeypatch.setattr(worker.compute, "write_computed", kept)
    healed = cluster.run_distributed(study, out, "local")
    assert healed.n_computed == 1
    assert everything_but_step_a(out) == everything(whole)


def test_the_window_is_bounded(study, tmp_path, in_process, monkeypatch):
    kept, most = dispatch._take, []

    def watched(job, client):
        most.append(len(job.out))
        kept(job, client)

    monkeypatch.setattr(dispatch, "_take", watched)
    cluster.run_distributed(study, tmp_path, "local", RunOptions(shard_size=1))
    assert 0 < max(most) <= 2 * dispatch.WINDOW


def test_a_damaged_step_a_is_refused(study, tmp_path, in_process):
    cluster.run_distributed(study, tmp_path, "local", RunOptions(shard_size=SIZE))
    from mcsettle.storage.location import place

    at = place(tmp_path)
    held = worker.read_step_a(at)
    assert held.digest == survey(tmp_path).provenance.transfer_digest
    name = next(n for n in at.names(worker.STEP_A) if n.endswith(".npz"))
    at.write(name, at.read(name)[:-100])
    with pytest.raises(InputError, match="damaged"):
        worker.read_step_a(at)
    for text in ("[]", '{"base": 1}', '{"base": {"v201": ["../../x"]}}'):
        at.write(worker.INDEX, text.encode())
        with pytest.raises(InputError, match=r"damaged|holds another"):
            worker.read_step_a(at)


def test_without_a_scheduler_it_says_so(study, tmp_path, monkeypatch):
    monkeypatch.setattr(dispatch, "FIRST_PATIENCE", 0.0)
    with pytest.raises(InputError, match=r"no scheduler answers at tcp://127.0.0.1:9"):
        cluster.run_distributed(study, tmp_path, "tcp://127.0.0.1:9", RunOptions(shard_size=SIZE))


def test_templates_are_sound_and_call_what_there_is():
    """Shell and YAML parse; the parts of both count from 1 to N; every option they give exists."""
    yaml = pytest.importorskip("yaml")
    folder = Path(__file__).resolve().parents[2] / "docs" / "cluster"
    script = folder / "slurm.sh"
    assert subprocess.run(["bash", "-n", str(script)], check=False).returncode == 0
    job = yaml.safe_load((folder / "kubernetes.yaml").read_text(encoding="utf-8"))["spec"]
    (container,) = job["template"]["spec"]["containers"]
    assert job["completionMode"] == "Indexed"
    called = container["args"][0]
    assert f'--shards "$((JOB_COMPLETION_INDEX + 1))/{job["completions"]}"' in called
    told = CliRunner().invoke(app, ["run", "--help"], env={"COLUMNS": "200"}).stdout
    for text in (called, script.read_text(encoding="utf-8").rpartition("exec ")[2]):
        assert text.split()[:2] == ["exec", "mcsettle"] or text.startswith("mcsettle run")
        for option in re.findall(r"--[a-z-]+", text):
            assert option in told
    assert "pip install" in (folder / "Dockerfile").read_text(encoding="utf-8")


# --- workers that outlive runs --------------------------------------------------------------------


def test_a_worker_tells_runs_apart(study, whole, tmp_path, in_process):
    """The same study into another folder, and then with more rows, by the same workers."""
    for name, n in (("a", 4), ("b", 4), ("b", N)):
        done = cluster.run_distributed(
            study, tmp_path / name, "local", RunOptions(realisations=n, shard_size=SIZE)
        )
        assert done.n_computed == (4 if n == 4 else 2)
    assert everything_but_step_a(tmp_path / "b") == everything(whole)
    assert survey(tmp_path / "a").realisations == 4


def test_a_worker_that_began_with_other_threads_says_so(study, tmp_path, in_process):
    with pytest.raises(InputError, match="is to use 77 threads and has begun with another number"):
        cluster.run_distributed(study, tmp_path, "local", RunOptions(threads=77, shard_size=SIZE))


def test_a_target_is_reached_by_workers_too(study, tmp_path, in_process):
    """The same batches, the same decision, the same bytes: results stand in the order of their rows."""
    path = tmp_path / "study.toml"
    path.write_text(resolved_toml(study), encoding="utf-8")
    told = {}
    for name, more in (("plain", []), ("shared", ["--scheduler", "local"])):
        done = CliRunner().invoke(
            app,
            ["run", str(path), "--out", str(tmp_path / name), "--realisations", "100",
             "--shard-size", "20", "--until", "tamping_interval median 0.1%", *more],
        )  # fmt: skip
        assert done.exit_code == 5, done.stderr
        assert "Target missed at the cap of 100 realisations" in done.stderr
        told[name] = [re.sub(r"[0-9.]+ s\b", "", line) for line in done.stdout.splitlines()]
    assert len(told["plain"]) == 2
    assert told["plain"] == told["shared"]
    assert everything_but_step_a(tmp_path / "shared") == everything(tmp_path / "plain")


# --- parameter sets -------------------------------------------------------------------------------


def shared_and_plain(study, tmp_path, **options):
    """A run by workers and one by two slices are the plain run; returns its folder."""
    plain = run_study(study, tmp_path / "plain", RunOptions(shard_size=SIZE, **options))
    for i in (2, 1):
        run_study(
            study, tmp_path / "parts", RunOptions(shards=Slice(i, 2), shard_size=SIZE, **options)
        )
    gather(tmp_path / "parts")
    assert everything(tmp_path / "parts") == everything(plain.folder)
    done = cluster.run_distributed(
        study, tmp_path / "shared", "local", RunOptions(shard_size=SIZE, **options)
    )
    assert everything(tmp_path / "shared") == everything(plain.folder)  # no Step A is left there
    assert done.n_failed == plain.n_failed
    assert set(done.remarks) == set(plain.remarks)
    return plain


def test_grounds_and_their_failures(tmp_path, in_process):
    """Three grounds, one of which cannot be run: that is told in its rows, and is no failed shard."""
    for name, text in (("layers", toy_grounds.LAYERS), ("weights", toy_grounds.WEIGHTS)):
        (tmp_path / f"{name}.csv").write_text(text, encoding="utf-8")
    plain = shared_and_plain(toy_grounds.study(tmp_path), tmp_path, realisations=2)
    assert plain.n_failed == 2 * 2
    assert survey(tmp_path / "shared").finished


def test_sets_that_share_their_rows(tmp_path, in_process, monkeypatch):
    """Sets that differ in money alone: the workers compute the first one's rows and copy them."""
    kept, computed = compute.write_computed, []

    def counted(job, member, scene, engine, shard):
        computed.append(shard.member)
        kept(job, member, scene, engine, shard)

    study = toy.uncertain(toy.COST, run={"realisations": 2, "parameter_sets": 3})
    plain = run_study(study, tmp_path / "plain").folder
    monkeypatch.setattr(compute, "write_computed", counted)
    cluster.run_distributed(study, tmp_path / "shared", "local")
    assert everything(tmp_path / "shared") == everything(plain)
    assert computed.count(0) == 2
    assert len(computed) < 6  # a set overtakes the first one at most now and then


def test_fitted_factors_reach_the_workers(tmp_path, in_process, monkeypatch):
    """A factor fitted in every set: the workers use the fits that lie in the folder."""
    monkeypatch.setattr(factor_fit, "FIT_TRACKS", 8)
    monkeypatch.setattr(factor_fit, "FEW_TRACKS", 4)
    observed = [{**toy.INTERVAL, "sections": 200}]
    study = toy.uncertain(toy.N0, toy.FITTED, observed=observed)
    shared_and_plain(study, tmp_path, realisations=2, parameter_sets=2)
