"""One study and its finished run for the tests of a file, which says its N, SIZE and SHARD."""

import pytest
import toy

from mcsettle.run import pipeline
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study


@pytest.fixture(scope="module")
def study(request):
    """The toy study with ``N`` realisations."""
    return toy.study(run={"realisations": request.module.N})


@pytest.fixture(scope="module")
def whole(request, fresh_cache, study, tmp_path_factory):
    """Folder of the study, run in one go in shards of ``SIZE``."""
    options = RunOptions(shard_size=request.module.SIZE)
    return run_study(study, tmp_path_factory.mktemp("whole") / "out", options).folder


@pytest.fixture(scope="module")
def finished(request, fresh_cache, study, tmp_path_factory):
    """The study run in shards of ``SHARD`` where the default is as small."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pipeline, "SHARD", request.module.SHARD)
        return run_study(study, tmp_path_factory.mktemp("run") / "results")


@pytest.fixture
def small_shards(request, monkeypatch):
    monkeypatch.setattr(pipeline, "SHARD", request.module.SHARD)
