"""Runs laid over one another: known shifts and stretches come back, what is left is the noise."""

import numpy as np
import pytest

from mcsettle.errors import InputError
from mcsettle.railway.filters import Band, band_passed
from mcsettle.railway.irregularity import sample_profiles, to_space, wavenumbers
from mcsettle.railway.record import Run
from mcsettle.railway.run_alignment import aligned, repeat_error
from mcsettle.railway.spectra import spectrum

LENGTH, STEP = 1600.0, 0.25
K = wavenumbers(LENGTH, 2.0, 90.0)


def track(x: np.ndarray, seed: int = 1) -> np.ndarray:
    return to_space(sample_profiles(spectrum("fra", 6), K, LENGTH, seed, [0]), K, x)[0]


def run(shift: float = 0.0, stretch: float = 0.0, noise: float = 0.0, seed: int = 1) -> Run:
    """A recording whose chainage is off by ``shift`` at the middle and by ``stretch`` besides."""
    x = np.arange(0.0, LENGTH, STEP)
    written = x - shift - stretch * (x - 0.5 * LENGTH)
    level = track(x, seed) + noise * np.random.default_rng(7).normal(size=len(x))
    return Run("2021-09-11", written, level)


@pytest.mark.parametrize(
    ("shift", "stretch"), [(0.0, 0.0), (3.3, 0.0), (-12.1, 2e-4), (7.7, -1e-3)]
)
def test_a_shift_and_a_stretch_come_back(shift: float, stretch: float) -> None:
    moved = aligned(run(), run(shift, stretch, noise=0.1e-3))
    x = moved.run.chainage
    assert np.max(np.abs(x - np.arange(0.0, LENGTH, STEP))) < 0.1  # m
    assert moved.residual < 0.1
    assert moved.misfit < 0.12e-3
    if shift:
        assert moved.misfit_before > 5.0 * moved.misfit
        assert "mm as recorded" in moved.text
    np.testing.assert_array_equal(moved.run.labels, run(shift, stretch).chainage)


def test_the_misfit_is_the_noise_of_the_band() -> None:
    noise = 0.2e-3
    moved = aligned(run(), run(4.0, 0.0, noise))
    passed = band_passed(noise * np.random.default_rng(7).normal(size=6400), STEP, Band())
    assert moved.misfit == pytest.approx(np.std(passed), rel=0.05)


def test_what_is_left_is_the_growth_and_not_the_shift() -> None:
    x = np.arange(0.0, LENGTH, STEP)
    growth = 0.3e-3 * np.sin(2 * np.pi * x / 12.0)
    moved = aligned(run(), Run("later", x - 5.0, track(x) + growth))
    assert moved.misfit == pytest.approx(0.3e-3 / np.sqrt(2.0), rel=0.05)
    assert moved.misfit_before > 1e-3


def test_another_track_and_no_track_in_common_are_refused() -> None:
    with pytest.raises(InputError, match=r"are alike nowhere within 20 m .*a tamping between"):
        aligned(run(), run(seed=2))
    far = Run("far", run().chainage + 9000.0, run().level)
    with pytest.raises(InputError, match="no chainage in common"):
        aligned(run(), far)
    with pytest.raises(InputError, match=r"100 m in common; aligning takes 240 m"):
        aligned(run(), Run("short", run().chainage + LENGTH - 100.0, run().level))


def test_the_error_of_an_sd_is_estimated_from_repeats_with_its_interval() -> None:
    """Over 400 lines of 30 sections and three recordings the interval of 95 % holds the truth."""
    rng = np.random.default_rng(3)
    true, inside, values = 0.04, 0, []
    for _ in range(400):
        sds = 1e-3 * np.exp(0.3 * rng.normal(size=30)) * np.exp(true * rng.normal(size=(3, 30)))
        sds[2, :10] = np.nan
        found = repeat_error(sds)
        assert (found.sections, found.degrees) == (30, 50)
        inside += found.low < true < found.high
        values.append(found.relative)
    assert np.mean(values) == pytest.approx(true, rel=0.02)
    assert abs(inside / 400 - 0.95) < 3.0 * np.sqrt(0.95 * 0.05 / 400)
    with pytest.raises(InputError, match="recorded twice"):
        repeat_error(np.array([[1.0, np.nan], [np.nan, 1.0]]))
