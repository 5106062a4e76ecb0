"""Taichi and its fork Quadrants give the same results to rounding; where both are installed."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

TESTS = Path(__file__).resolve().parents[1]
TOLERANCE = 1e-10  # of the largest: two compilers order and contract sums differently
RUNS = (("cycle_jump", "spectral"), ("every_axle", "spectral"), ("every_axle", "pointwise"))
SCRIPT = """
import sys
import numpy as np
from mcsettle.kernels import runtime
runtime.start(2)
import toy
from mcsettle.step_b.engine import engine_for
case = toy.case((("passenger", 20), ("freight", 15)), shortest=8.0, horizon=1.0, settlement_factor=6.2e3)
found = {"name": np.array(runtime.NAME)}
for stepping, side in %r:
    engine = engine_for(case, stepping, side)
    outcome = engine.run(toy.profiles(range(10), shortest=8.0), np.array([0.0, 0.5, 1.0]))
    for name in ("days", "amplitudes", "history", "mean_settlement", "passages"):
        found[f"{stepping} {side} {name}"] = np.asarray(getattr(outcome, name))
np.savez(sys.argv[1], **found)
""" % (RUNS,)  # noqa: UP031


def outcomes(runtime: str, file: Path) -> dict[str, np.ndarray]:
    path = os.pathsep.join([str(TESTS), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    own = {"PYTHONPATH": path, "MCSETTLE_RUNTIME": runtime}
    subprocess.run([sys.executable, "-c", SCRIPT, str(file)], check=True, env=os.environ | own)
    with np.load(file) as data:
        return dict(data)


@pytest.mark.skipif(
    importlib.util.find_spec("quadrants") is None, reason="the extra quadrants is not installed"
)
def test_both_runtimes_give_the_same(tmp_path: Path) -> None:
    one, other = (outcomes(name, tmp_path / f"{name}.npz") for name in ("taichi", "quadrants"))
    assert (str(one.pop("name")), str(other.pop("name"))) == ("taichi", "quadrants")
    assert one.keys() == other.keys()
    assert len(one) == 5 * len(RUNS)
    for key, value in one.items():
        largest = np.max(np.abs(value), where=np.isfinite(value), initial=0.0)
        np.testing.assert_allclose(other[key], value, rtol=0, atol=TOLERANCE * largest, err_msg=key)
