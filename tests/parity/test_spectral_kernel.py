"""The spectral kernels against NumPy: one evaluation, and a march of some hundred updates."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import toy

from mcsettle.kernels import lanes, runtime, spectral
from mcsettle.step_b.mode_pairs import mode_pairs
from mcsettle.step_b.spectral import axle_form, fast_growth, growth, march_tables, stacked

# Both sum some thousand products in f64 in another order: 1e-13 of the largest, with room.
TOLERANCE = 1e-10
TESTS = Path(__file__).resolve().parents[1]


def forms(shortest=3.0, stress="traffic", trains=("passenger", "freight")):
    modes = np.arange(6, {3.0: 67, 8.0: 26}[shortest])
    pairs = mode_pairs(modes)
    model = toy.model(stress=stress)
    return pairs, [
        axle_form(toy.transfer(train, shortest=shortest), axle, model, pairs)
        for train in trains
        for axle in (0, 6)
    ]


def close(a, b):
    np.testing.assert_allclose(a, b, rtol=0, atol=TOLERANCE * np.abs(b).max())


@pytest.mark.parametrize("n", [1, 63, 64, 65, 200])
@pytest.mark.parametrize("stress", ["traffic", "total"])
def test_one_evaluation(n, stress):
    """Any number of realisations, each with weights of its own."""
    pairs, (first, *_) = forms(stress=stress)
    amplitudes = toy.profiles(range(n))
    weights = np.random.default_rng(n).random((n, 3))
    change, uniform = fast_growth(first, first.packed(), amplitudes, weights, pairs)
    expected, expected_uniform = growth(first, amplitudes, weights, pairs)
    close(change, expected)
    np.testing.assert_allclose(uniform, expected_uniform, rtol=TOLERANCE)


@pytest.mark.parametrize("n_forms", [1, 2, 4])
def test_several_groups_of_weights(n_forms):
    """3, 6 and 12 weights: one, two and four services side by side."""
    pairs, found = forms(shortest=8.0)
    form = stacked(found[:n_forms])
    amplitudes = toy.profiles(range(67), shortest=8.0)
    weights = np.random.default_rng(1).normal(size=(67, 3 * n_forms))
    change, uniform = fast_growth(form, form.packed(), amplitudes, weights, pairs)
    expected, expected_uniform = growth(form, amplitudes, weights, pairs)
    close(change, expected)
    close(uniform, expected_uniform)


def test_more_realisations_than_one_launch_holds():
    pairs, (form, *_) = forms(shortest=8.0)
    n = spectral.CAPACITY + 3
    amplitudes = np.resize(toy.profiles(range(100), shortest=8.0), (n, 20))
    amplitudes = amplitudes * np.linspace(0.5, 1.0, n)[:, None]
    weights = np.random.default_rng(2).random((n, 3))
    change, _ = fast_growth(form, form.packed(), amplitudes, weights, pairs)
    close(change, growth(form, amplitudes, weights, pairs)[0])


def numpy_march(amplitudes, limit, load, weights, loads, pairs):
    """The march written out: every row on its own, one update after the other."""
    u, uniform = amplitudes.copy(), np.zeros(len(amplitudes))
    updates = np.zeros(len(u), int)
    active = np.sum(np.abs(u) ** 2, axis=1) < limit
    for form, weight in zip(load, weights, strict=True):
        rows = np.flatnonzero(active)
        change, settled = growth(loads[form], u[rows], np.tile(weight, (len(rows), 1)), pairs)
        u[rows] += change
        uniform[rows] += settled
        updates[rows] += 1
        active[rows] = np.sum(np.abs(u[rows]) ** 2, axis=1) < limit
    return u, uniform, updates, active


@pytest.mark.parametrize("n", [1, 70])
def test_a_march_through_the_limit(n):
    """400 updates by four axles of two trains; most rows cross the limit, each at its own update."""
    runtime.start()
    pairs, loads = forms(shortest=8.0)
    sd = np.linspace(1.3e-3, 1.52e-3, n)[::-1, None]  # the first rows are over the limit already
    amplitudes = toy.profiles(range(n), sd=1.0, shortest=8.0) * sd
    limit = 2 * toy.SD_LIMIT**2
    rng = np.random.default_rng(5)
    load = rng.integers(0, 4, 400).astype(np.int32)
    weights = toy.FACTOR * 1.5e-4 * rng.random((400, 3))
    expected = numpy_march(amplitudes, limit, load, weights, loads, pairs)
    state = lanes.March(amplitudes, limit, march_tables(pairs), pairs.first, 3)
    parts = [np.stack([getattr(f, name) for f in loads]) for name in ("constant", "mean")]
    form = np.stack([f.packed(pairs.terms.order) for f in loads])
    for piece in (slice(0, 1), slice(1, 150), slice(150, 400)):
        state.advance(load[piece], weights[piece], form, *parts)
    close(state.amplitudes(), expected[0])
    np.testing.assert_allclose(state.uniform(), expected[1], rtol=TOLERANCE)
    np.testing.assert_array_equal(state.updates(), expected[2])
    np.testing.assert_array_equal(state.is_active(), expected[3])
    if n > 1:
        crossed = expected[2][(expected[2] > 0) & ~expected[3]]
        assert expected[2].min() == 0  # started over the limit
        assert expected[3].any()  # still below it
        assert len(np.unique(crossed)) > 10  # and crossings all along


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_small_tiles_change_no_bit(precision):
    """A march of as many as one tile holds is divided among small ones; rows march alike in both."""
    runtime.start()
    pairs, loads = forms(shortest=8.0)
    parts = [np.stack([f.packed(pairs.terms.order) for f in loads])]
    parts += [np.stack([getattr(f, name) for f in loads]) for name in ("constant", "mean")]
    load, weights = np.arange(40, dtype=np.int32) % 4, np.full((40, 3), toy.FACTOR * 1e-4)
    amplitudes = toy.profiles(range(70), shortest=8.0)
    found = []
    for rows in (70, 9):
        march = lanes.March(amplitudes[:rows], 1.0, march_tables(pairs), pairs.first, 3, precision)
        march.advance(load, weights, *parts)
        found.append((march.lanes, march.amplitudes()[:9], march.uniform()[:9]))
    (full, *whole), (small, *few) = found
    assert small == full // spectral.FEW
    np.testing.assert_array_equal(whole[0], few[0])
    np.testing.assert_array_equal(whole[1], few[1])


def test_a_broken_neighbour_is_not_felt():
    """A row of NaN changes no bit of the rows beside it."""
    pairs, (form, *_) = forms(shortest=8.0)
    amplitudes, weights = toy.profiles(range(6), shortest=8.0), np.full((6, 3), 1e-3)
    clean, _ = fast_growth(form, form.packed(), amplitudes, weights, pairs)
    spoilt = amplitudes.copy()
    spoilt[3] = np.nan
    change, _ = fast_growth(form, form.packed(), spoilt, weights, pairs)
    others = [0, 1, 2, 4, 5]
    np.testing.assert_array_equal(change[others], clean[others])
    assert np.isnan(change[3]).all()


def test_a_batch_of_a_march_has_a_size():
    pairs, _ = forms(shortest=8.0)
    with pytest.raises(ValueError, match="at most 2048"):
        lanes.March(np.zeros((spectral.CAPACITY + 1, 20)), 1.0, march_tables(pairs), pairs.first, 3)


SCRIPT = """
import sys
import numpy as np
from mcsettle.kernels import runtime
assert runtime.start(debug=True)["debug"]
import toy
from mcsettle.step_b.engine import engine_for
from mcsettle.step_b.pointwise import pointwise_growth, pointwise_load
from mcsettle.step_b.mode_pairs import mode_pairs
from mcsettle.step_b.spectral import axle_form, fast_growth
case = toy.case((("car", 2), ("freight", 1)), shortest=8.0, horizon=1.0)
u = toy.profiles(range(65), shortest=8.0)
engine_for(case, "every_axle").run(u, np.array([0.0, 0.5]))
pairs = mode_pairs(np.arange(6, 26))
transfer = toy.transfer("car", shortest=8.0)
form = axle_form(transfer, 0, case.model, pairs)
fast_growth(form, form.packed(), u, np.ones((65, 3)), pairs)
load = pointwise_load(transfer, case.model, case.window)
pointwise_growth(load, np.array([0]), u[:9], np.ones((9, 3)))
print("sound", flush=True)
pairs.sums[-1, 0] = 20  # one past the last mode
try:
    fast_growth(form, form.packed(), u, np.ones((65, 3)), pairs)
except Exception as error:
    print("caught", type(error).__name__, flush=True)
"""


def test_no_kernel_leaves_its_arrays():
    """With bounds checks in a process of its own; a spoilt index table must be caught there."""
    path = os.pathsep.join([str(TESTS), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": path.rstrip(os.pathsep)},
    )  # fmt: skip
    assert done.stdout.splitlines()[0] == "sound", done.stderr
    assert done.stdout.splitlines()[1].endswith("AssertionError"), done.stderr
