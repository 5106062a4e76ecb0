"""Shared settings of the tests: one BLAS thread, the toy study."""

import os
from pathlib import Path

import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository's top level."""
    return ROOT


@pytest.fixture(scope="session")
def toy_path() -> Path:
    """The toy study's file."""
    return ROOT / "studies" / "toy.toml"
