"""Folders and object stores behind one set of verbs; whole runs into a local S3 server."""

import os
import re
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import pytest
import toy
from alarm import in_time
from toy import everything
from typer.testing import CliRunner

from mcsettle.cli.app import app
from mcsettle.errors import InputError
from mcsettle.run.close import gather
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study
from mcsettle.run.shards import Slice
from mcsettle.run.status import survey
from mcsettle.step_a import transfer_cache, transfers
from mcsettle.storage.files import cache_folder
from mcsettle.storage.location import Bucket, Folder, place
from mcsettle.summary.results import read_results
from mcsettle.summary.summary import summary_rows

moto = pytest.importorskip("moto.server")
pytestmark = [
    pytest.mark.usefixtures("fresh_cache"),
    pytest.mark.filterwarnings("ignore:.*:DeprecationWarning"),  # of the server's libraries
]
N, SIZE = 4, 2


@pytest.fixture(scope="module")
def bucket():
    """An empty bucket of a server on this machine, found by the usual variables."""
    server = moto.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AWS_ACCESS_KEY_ID", "test")
        patch.setenv("AWS_SECRET_ACCESS_KEY", "test")
        patch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        patch.setenv("AWS_EC2_METADATA_DISABLED", "true")
        patch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
        put = urllib.request.Request(f"http://{host}:{port}/bucket", method="PUT")
        urllib.request.urlopen(put).close()
        yield "s3://bucket"
    server.stop()


@pytest.fixture(scope="module")
def google():
    """URL of a run in a bucket of a server on this machine, in a process of its own.

    Google's client keeps the interpreter's lock while it waits, so the server cannot be a thread.
    """
    pytest.importorskip("gcp_storage_emulator")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = str(probe.getsockname()[1])
    server = [sys.executable, "-W", "ignore", "-m", "gcp_storage_emulator", "start", "-q", "-M"]
    process = subprocess.Popen(
        [*server, "-H", "127.0.0.1", "--port", port, "--default-bucket", "bucket"]
    )
    where = f"?scheme=http&endpoint_override=127.0.0.1:{port}&retry_limit_seconds=60"
    place(f"gs://anonymous@bucket/wait{where}").exists()  # until it answers
    yield lambda name: f"gs://anonymous@bucket/{name}{where}"
    process.kill()
    process.wait()


@pytest.fixture(params=["folder", "s3", "gs"])
def at(request, tmp_path):
    if request.param == "folder":
        return place(tmp_path / "x")
    if request.param == "gs":
        return place(request.getfixturevalue("google")(tmp_path.name))
    return place(f"{request.getfixturevalue('bucket')}/{tmp_path.name}")


def test_verbs(at):
    assert not at.exists()
    assert at.names() == []
    at.write("b/c.txt", b"first")
    at.write("b/c.txt", b"second")
    at.write(".a", "ü".encode())
    assert at.exists()
    assert at.read("b/c.txt") == b"second"
    assert at.text(".a", 10) == "ü"
    assert at.names() == [".a", "b/c.txt"]
    assert at.names("b") == ["b/c.txt"]
    assert at.names("none") == []
    at.remove(".a")
    at.remove(".a")
    assert at.names() == ["b/c.txt"]
    with pytest.raises(FileNotFoundError):
        at.read("none")
    with pytest.raises(InputError, match="at most 3"):
        at.read("b/c.txt", 3)
    at.write("bad", b"\xff")
    with pytest.raises(InputError, match="no UTF-8"):
        at.text("bad", 10)


def test_a_url_survives_pathlib():
    assert isinstance(place(Path("results/s3:/x")), Folder)
    found = place(Path("s3://bucket/run/"))
    assert isinstance(found, Bucket)
    assert str(found) == "s3://bucket/run"
    assert str(place("s3://key:secret@bucket/run?region=x")) == "s3://bucket/run"


@pytest.mark.parametrize(
    ("url", "said"),
    [
        (
            "s3a://key:secret@bucket/run",
            r"s3a:// is not served here; did you mean s3://bucket/run\?",
        ),
        ("file:///x/run", "file:// is not served here; give a folder"),
        ("hdfs://h/run", "hdfs:// is not served here"),
        ("http://h/run", "http:// is not served here"),
        ("", "name is empty"),
    ],
)
def test_what_is_not_served_is_refused(url, said):
    for where in (url, Path(url)) if url else (url,):
        with pytest.raises(InputError, match=said):
            place(where)


def test_capitals_of_a_scheme_do_not_matter(tmp_path):
    assert str(place("S3://bucket/run?region=x")) == "s3://bucket/run"
    assert isinstance(place("C:/results"), Folder)


@pytest.mark.parametrize("scheme", ["s3://k:s@", "gs://anonymous@"])
def test_a_store_that_never_answers_is_said_to_within_ten_seconds(scheme):
    """It takes connections, and that is all."""
    with socket.create_server(("127.0.0.1", 0), backlog=100) as silent:
        server = f"127.0.0.1:{silent.getsockname()[1]}"
        began = time.monotonic()
        with pytest.raises(InputError, match="bucket/run"):
            place(f"{scheme}bucket/run?endpoint_override={server}&scheme=http").exists()
        assert time.monotonic() - began < 10.0


@pytest.mark.parametrize(
    "url", ["s3://no-such-bucket/run", "s3://b/x?endpoint_override=127.0.0.1:9&scheme=http"]
)
def test_a_store_that_cannot_be_reached_is_told_in_words(bucket, url):
    with pytest.raises(InputError, match="check the URL and the credentials"):
        place(url).write("x", b"")


AZURE = "abfs://container@account.dfs.core.windows.net/run"


SAID = "check the URL and the credentials"


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("gcs://anonymous@b/x?endpoint_override=127.0.0.1:9&scheme=http", f"gcs://b/x: .*{SAID}"),
        ("gs://bucket/run?such=1", "cannot be used: Unexpected query parameter.*such"),
        ("abfs://container/run", "cannot be used: .*account"),
        ("abfss://c@a/run?such=1", "cannot be used: Unexpected query parameter.*such"),
    ],
)
def test_urls_of_other_stores_are_pyarrows(url, said):
    with pytest.raises(InputError, match=said):
        place(url).exists()


@pytest.mark.parametrize("url", ["gs://bucket/run", AZURE])
def test_without_credentials_other_stores_say_so(url, tmp_path):
    """Through the command, in a process that finds none: soon, in words, without a trace."""
    environment = {
        "PATH": os.defpath,
        "HOME": str(tmp_path),
        "GOOGLE_APPLICATION_CREDENTIALS": str(tmp_path / "none.json"),
        "OPENBLAS_NUM_THREADS": "1",
    }
    done = subprocess.run(
        [sys.executable, "-c", "from mcsettle.cli.app import main; main()", "status", url],
        capture_output=True, text=True, check=False, env=environment, timeout=60,
    )  # fmt: skip
    assert done.returncode == 2, done.stderr
    assert re.search(f"{url}: .*{SAID}", " ".join(done.stderr.split())), done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""


def test_what_is_secret_in_a_url_is_not_shown():
    for url, shown in (
        ("abfs://account:key@account.dfs.core.windows.net/c/run", "abfs://account.dfs.core.windows.net/c/run"),
        (AZURE, AZURE),
        ("gs://anonymous@bucket/run?scheme=http", "gs://bucket/run"),
    ):  # fmt: skip
        assert str(place(url)) == shown


def test_pipes_and_devices_are_not_read(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    os.symlink("/dev/zero", tmp_path / "zero")
    for name in ("pipe", "zero"):
        with (
            in_time(wall=10.0),
            pytest.raises(InputError, match=r"not a regular file|is a link"),
        ):
            place(tmp_path).read(name)
    (tmp_path / "/".join("abcdefghij")).mkdir(parents=True)
    with pytest.raises(InputError, match="too deep"):
        place(tmp_path).names()


@pytest.mark.parametrize("kind", ["s3", "gs"])
def test_a_run_in_a_store_is_the_run_in_a_folder(kind, request, tmp_path):
    """Slices, status, gather, growth, summary: object by object the bytes of the folder."""
    study = toy.tiny(run={"realisations": N})
    folder = tmp_path / "folder"
    if kind == "gs":
        url = request.getfixturevalue("google")("runs/one")
    else:
        url = f"{request.getfixturevalue('bucket')}/runs/one"
    run_study(study, folder, RunOptions(shard_size=SIZE))
    for i in (2, 1):
        run_study(study, url, RunOptions(shards=Slice(i, 2), shard_size=SIZE))
    with pytest.raises(InputError, match="is not finished"):
        read_results(url)
    assert gather(url).finished
    held = {n: place(url).read(n) for n in place(url).names() if not n.startswith(".locks")}
    assert held == everything(folder)
    assert summary_rows(read_results(url)) == summary_rows(read_results(folder))
    for verb in ("summarise", "status"):
        done = CliRunner().invoke(app, [verb, url])
        assert done.exit_code == 0, done.stderr
    place(url).write("realisations/base--v201--00000000-00000001.parquet", b"damaged")
    assert survey(url).faults[0].state == "damaged"
    again = run_study(study, url)
    assert again.n_computed == 1
    with pytest.raises(InputError, match="seed 1 where this run has 2"):
        run_study(study, url, RunOptions(seed=2))


def test_a_shared_cache_is_filled_and_used(bucket, tmp_path, monkeypatch):
    """Another machine, with an empty cache folder, computes nothing of Step A again."""
    study = toy.study()
    monkeypatch.setenv("MCSETTLE_CACHE", f"{bucket}/cache")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "first"))
    first = transfers.step_a(study.scenes)
    shared = place(f"{bucket}/cache").names()
    assert len(shared) == 2
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "second"))
    monkeypatch.setattr(transfer_cache, "precompute", None)
    assert transfers.step_a(study.scenes).digest == first.digest
    assert sorted(p.name for p in cache_folder().glob("*.npz")) == shared


def test_a_cache_file_of_something_else_is_not_used(tmp_path, monkeypatch):
    monkeypatch.setenv("MCSETTLE_CACHE", str(tmp_path))
    first = transfers.step_a(toy.study().scenes)
    one, two = sorted(tmp_path.glob("transfer-*.npz"))
    one.write_bytes(two.read_bytes())
    told = []
    again = transfers.step_a(toy.study().scenes, lambda text, *_: told.append(text))
    assert again.digest == first.digest
    assert any("something else" in text for text in told)
