"""Results do not depend on threads, batches, order or neighbours: to the last bit."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import toy

from mcsettle.kernels import runtime
from mcsettle.step_b.case import Case
from mcsettle.step_b.engine import engine_for

TESTS = Path(__file__).resolve().parents[1]
N = 70  # a full tile of lanes and a begun one
DAYS = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
FIELDS = ("days", "amplitudes", "history", "mean_settlement", "passages", "reached", "steps")
STEPPINGS = ("cycle_jump", "every_axle")
RUNS = (("cycle_jump", "spectral"), ("every_axle", "spectral"), ("every_axle", "pointwise"))


def quick(services=(("passenger", 20), ("freight", 15))) -> Case:
    """Some realisations reach the limit within the day (420 updates), others run out of time."""
    return toy.case(services, shortest=8.0, horizon=1.0, settlement_factor=6.2e3)


def tracks(indices=range(N)) -> np.ndarray:
    return toy.profiles(indices, shortest=8.0)


def assert_same_bits(a, b):
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


class Part:
    """The rows of an outcome, chosen or joined."""

    def __init__(self, outcomes, rows=slice(None)):
        for name in FIELDS:
            joined = np.concatenate([getattr(outcome, name) for outcome in outcomes])
            setattr(self, name, joined[rows])


@pytest.fixture(scope="module", params=STEPPINGS)
def engine(request):
    return engine_for(quick(), request.param)


@pytest.fixture(scope="module")
def together(engine):
    outcome = engine.run(tracks(), DAYS)
    assert 10 < outcome.reached.sum() < N - 10  # both kinds of end are compared
    return outcome


@pytest.mark.parametrize("batch", [1, 7, 64])
def test_batches(engine, together, batch):
    starts = range(0, N, batch) if batch > 1 else [0, 1, 33, 63, 64, N - 1]
    parts = [range(s, min(s + batch, N)) for s in starts]
    rows = np.concatenate([np.arange(p.start, p.stop) for p in parts])
    apart = Part([engine.run(tracks(part), DAYS) for part in parts])
    assert_same_bits(apart, Part([together], rows))


def test_order(engine, together):
    order = np.random.default_rng(1).permutation(N)
    assert_same_bits(engine.run(tracks(order), DAYS), Part([together], order))


def test_repetition(engine, together):
    """Nothing is left over in the reused fields of the kernels."""
    engine.run(toy.profiles(range(100, 110), sd=1.2e-3, shortest=8.0), DAYS[:1])
    assert_same_bits(engine.run(tracks(), DAYS), together)


def test_a_failed_neighbour(engine, together):
    spoilt = tracks()
    spoilt[[3, 40]] = np.nan
    others = np.setdiff1d(np.arange(N), [3, 40])
    with np.errstate(invalid="ignore"):
        outcome = engine.run(spoilt, DAYS)
    assert_same_bits(Part([outcome], others), Part([together], others))
    assert outcome.failed[[3, 40]].all()
    assert not outcome.reached[[3, 40]].any()


def test_long_window():
    """1000 m, where the SD over 200 m is a product with a matrix."""
    case = toy.case((("car", 20),), window=1000.0, shortest=12.0, settlement_factor=1e4)
    engine = engine_for(case)
    everyone = engine.run(toy.profiles(range(9), window=1000.0, shortest=12.0), DAYS)
    assert everyone.reached.all()
    parts = [
        engine.run(toy.profiles(part, window=1000.0, shortest=12.0), DAYS)
        for part in (range(1), range(1, 3), range(3, 9))
    ]
    assert_same_bits(Part(parts), everyone)


@pytest.mark.parametrize("stepping", STEPPINGS)
def test_pointwise(stepping):
    case = toy.case((("car", 100),), shortest=20.0, horizon=0.5, settlement_factor=1e4)
    engine = engine_for(case, stepping, "pointwise")
    everyone = engine.run(toy.profiles(range(70), shortest=20.0), DAYS[:1])
    order = np.random.default_rng(1).permutation(70)
    mixed = engine.run(toy.profiles(order, shortest=20.0), DAYS[:1])
    assert_same_bits(mixed, Part([everyone], order))
    parts = [engine.run(toy.profiles(p, shortest=20.0), DAYS[:1]) for p in (range(3), range(3, 70))]
    assert_same_bits(Part(parts), everyone)


SCRIPT = """
import sys
import numpy as np
sys.path[:0] = sys.argv[3:]
import test_bits
np.savez(sys.argv[2], **test_bits.outcomes(threads=int(sys.argv[1])))
"""


def outcomes(threads=None):
    """All that 130 realisations come to, by stepping, right-hand side and field."""
    found = {}
    for stepping, side in RUNS:
        outcome = engine_for(quick(), stepping, side, threads=threads).run(tracks(range(130)), DAYS)
        found |= {"-".join((stepping, side, name)): getattr(outcome, name) for name in FIELDS}
    return found


def test_threads(tmp_path):
    """Another number elsewhere; 130 realisations are three tiles, more than the two threads share."""
    here = runtime.start()["threads"]
    path, folders = tmp_path / "other.npz", [str(TESTS), str(TESTS / "invariance")]
    other = "1" if here != 1 else "2"
    subprocess.run(
        [sys.executable, "-c", SCRIPT, other, str(path), *folders], check=True, env=dict(os.environ)
    )
    found = dict(np.load(path))
    assert len(found) == len(RUNS) * len(FIELDS)
    for name, values in outcomes().items():
        np.testing.assert_array_equal(values, found[name], err_msg=name)
