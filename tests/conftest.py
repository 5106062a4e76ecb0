"""Shared settings of the tests: one BLAS thread, the toy study."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Nothing measures time: a busy machine is no fault of an example.
settings.register_profile("tests", deadline=None)
settings.load_profile("tests")
ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository's top level."""
    return ROOT


@pytest.fixture(scope="session")
def toy_path() -> Path:
    """The toy study's file."""
    return ROOT / "studies" / "toy.toml"


@pytest.fixture(scope="module")
def fresh_cache(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Path]:
    """Step A is computed anew by the code under test; compiled kernels stay where they are.

    Within the session the response of the toy track is computed once, and no finer than needed; a file
    whose runs are continued by other processes (``PROCESSES``) takes the one that they compute.
    """
    import toy

    from mcsettle.kernels import runtime
    from mcsettle.step_a import track_response

    runtime.start()
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MCSETTLE_CACHE", str(folder))
        alone = not getattr(request.module, "PROCESSES", False)
        response = toy.beam_response_once if alone else toy.full_beam_response_once
        patch.setattr(track_response, "beam_response", response)
        yield folder


@pytest.fixture(scope="module")
def few_resamples() -> Iterator[None]:
    """A tenth of the bootstrap's resamples: for runs that are compared with one another."""
    from mcsettle.estimate import resampling

    resampling._counts.cache_clear()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(resampling, "RESAMPLES", resampling.RESAMPLES // 10)
        yield
    resampling._counts.cache_clear()
