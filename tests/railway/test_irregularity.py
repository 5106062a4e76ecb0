"""Profiles have the spectrum, the standard deviation and the distribution they promise."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import kurtosis

from mcsettle.errors import InputError
from mcsettle.railway.irregularity import (
    default_section,
    profile_modes,
    sample_profiles,
    section_points,
    standard_deviation,
    to_space,
    wavenumbers,
)
from mcsettle.railway.spectra import spectrum

WINDOW = 200.0
SEED = 20_240
BAND = wavenumbers(WINDOW)

# Standard deviation in 3–35 m [mm] for classes 1 to 6, from an independent quadrature in ln n.
CLASS_SD_MM = {
    "fra": (7.258, 5.478, 4.083, 3.055, 2.295, 1.732),
    "fra_one_corner": (10.869, 9.967, 8.155, 7.242, 4.521, 1.819),
}


def band_sd_mm(density, shortest=3.0, longest=35.0):
    """Square root of ∫S dk over the band, in ln k."""
    edges = np.log(2.0 * np.pi / np.array([longest, shortest]))
    variance, _ = quad(lambda t: density(np.exp(t)) * np.exp(t), *edges, epsrel=1e-10)
    return 1e3 * np.sqrt(variance)


def errors_from_spectrum(profiles, density):
    """Distance of the mean periodogram from a spectrum, per mode, in standard errors.

    |U|²/2 has an exponential distribution with mean SΔk, so its standard error is SΔk/√R.
    """
    target = density(BAND) * 2.0 * np.pi / WINDOW
    mean = np.mean(0.5 * np.abs(profiles) ** 2, axis=0)
    return (mean / target - 1.0) * np.sqrt(len(profiles))


@pytest.fixture(scope="module")
def profiles():
    return sample_profiles(spectrum("fra", 6), BAND, WINDOW, SEED, range(4000))


@pytest.mark.parametrize("name", CLASS_SD_MM)
@pytest.mark.parametrize("fra_class", range(1, 7))
def test_class_has_published_standard_deviation(name, fra_class):
    expected = CLASS_SD_MM[name][fra_class - 1]
    # Half a unit of the last printed digit.
    assert band_sd_mm(spectrum(name, fra_class)) == pytest.approx(expected, abs=5e-4)


@pytest.mark.parametrize(
    ("name", "shortest", "longest", "expected"),
    [
        ("fra", 3.0, 25.0, 1.291),
        ("fra_one_corner", 3.0, 25.0, 1.429),
        ("german_low", 3.0, 35.0, 1.251),
        ("german_high", 3.0, 35.0, 2.047),
        ("german_low", 25.0, 70.0, 1.651),
        ("german_high", 70.0, 150.0, 3.474),
    ],
)
def test_spectrum_in_other_bands(name, shortest, longest, expected):
    assert band_sd_mm(spectrum(name), shortest, longest) == pytest.approx(expected, abs=5e-4)


def test_modes_of_the_band():
    assert profile_modes(200.0).tolist() == list(range(6, 67))
    assert profile_modes(1000.0)[[0, -1]].tolist() == [29, 333]
    assert profile_modes(210.0)[[0, -1]].tolist() == [6, 70]  # both edges are waves of the window
    np.testing.assert_allclose(BAND, 2.0 * np.pi * np.arange(6, 67) / 200.0, rtol=1e-15)


def test_profiles_have_the_target_spectrum(profiles):
    errors = errors_from_spectrum(profiles, spectrum("fra", 6))
    # 61 independent modes: no single one beyond 4 errors, and their mean square near 1
    # (mean square of 61 standard errors has a standard error of √(2/61) = 0.18).
    assert np.max(np.abs(errors)) < 4.0
    assert abs(np.mean(errors**2) - 1.0) < 4.0 * np.sqrt(2.0 / len(BAND))


@pytest.mark.parametrize(("name", "fra_class"), [("fra", 5), ("fra_one_corner", 6)])
def test_a_wrong_spectrum_is_found_out(profiles, name, fra_class):
    errors = errors_from_spectrum(profiles, spectrum(name, fra_class))
    assert abs(np.mean(errors**2) - 1.0) > 40.0 * np.sqrt(2.0 / len(BAND))


def test_mean_variance_is_the_sum_of_the_spectrum(profiles):
    variance = standard_deviation(profiles) ** 2
    target = np.sum(spectrum("fra", 6)(BAND)) * 2.0 * np.pi / WINDOW
    error = np.std(variance, ddof=1) / np.sqrt(len(variance))
    assert abs(np.mean(variance) - target) < 4.0 * error
    # The grid of a 200 m window holds 1.03 times the standard deviation of the continuous band.
    assert 1e3 * np.sqrt(target) / band_sd_mm(spectrum("fra", 6)) == pytest.approx(1.03, abs=0.005)
    # The standard deviation varies from track to track by 15–17 %, as Gaussian amplitudes have it.
    sd = np.sqrt(variance)
    assert 0.14 < np.std(sd) / np.mean(sd) < 0.18


def test_amplitudes_and_heights_are_gaussian(profiles):
    # Excess kurtosis of n normal numbers has standard error √(24/n); fixed amplitudes with random
    # phases would give −1.5 for every mode.
    parts = np.concatenate([profiles[:, 0].real, profiles[:, 0].imag])
    assert abs(kurtosis(parts)) < 4.0 * np.sqrt(24.0 / len(parts))
    heights = to_space(profiles, BAND, np.array([0.0, 71.3]))
    for column in heights.T:
        assert abs(kurtosis(column)) < 4.0 * np.sqrt(24.0 / len(column))


def test_profiles_are_stationary(profiles):
    variance = np.var(to_space(profiles, BAND, np.linspace(0.0, WINDOW, 9)), axis=0)
    # Variance of n normal numbers has relative standard error √(2/n).
    assert np.max(np.abs(variance / np.mean(variance) - 1.0)) < 4.5 * np.sqrt(2.0 / len(profiles))


def test_rescaled_profiles_have_exactly_the_asked_sd():
    profiles = sample_profiles(spectrum(), BAND, WINDOW, SEED, range(50), sd=1.03e-3)
    # A few roundings of a square root and a product.
    np.testing.assert_allclose(standard_deviation(profiles), 1.03e-3, rtol=1e-14)


def test_parseval_equals_the_heights():
    profiles = sample_profiles(spectrum(), BAND, WINDOW, SEED, range(5))
    # More than two points a wave: the mean of squares over the period is exact.
    heights = to_space(profiles, BAND, np.arange(0.0, WINDOW, 0.5))
    np.testing.assert_allclose(standard_deviation(profiles), np.std(heights, axis=1), rtol=1e-12)


def test_to_space_is_the_fourier_sum():
    profiles = sample_profiles(spectrum(), BAND, WINDOW, SEED, range(3))
    x = np.linspace(-10.0, 30.0, 7)
    expected = (profiles @ np.exp(1j * np.outer(BAND, x))).real
    np.testing.assert_allclose(to_space(profiles, BAND, x), expected, atol=1e-15)


@pytest.mark.parametrize(("window", "section"), [(200.0, None), (1000.0, 200.0)])
@pytest.mark.parametrize("sd", [None, 1.7e-3])
def test_address_alone_decides(window, section, sd):
    k = wavenumbers(window)
    together = sample_profiles(spectrum(), k, window, SEED, range(30), sd, section)
    shuffled = [17, 3, 29, 0]
    np.testing.assert_array_equal(
        sample_profiles(spectrum(), k, window, SEED, shuffled, sd, section), together[shuffled]
    )
    alone = sample_profiles(spectrum(), k, window, SEED, [17], sd, section)
    np.testing.assert_array_equal(alone[0], together[17])
    x = np.linspace(0.0, window, 33)
    np.testing.assert_array_equal(to_space(alone, k, x)[0], to_space(together, k, x)[17])
    np.testing.assert_array_equal(
        standard_deviation(alone, k, section)[0], standard_deviation(together, k, section)[17]
    )


def test_seed_and_index_are_different_coordinates():
    def first(seed, index):
        return sample_profiles(spectrum(), BAND, WINDOW, seed, [index])[0, 0]

    addresses = [(0, 0), (0, 1), (1, 0), (5, 7), (7, 5), (2**64 - 1, 7)]
    assert len({first(*address) for address in addresses}) == len(addresses)


def test_more_modes_leave_the_first_ones_as_they_are():
    wide = wavenumbers(WINDOW, shortest=2.0)
    np.testing.assert_array_equal(
        sample_profiles(spectrum(), wide, WINDOW, SEED, [4])[:, : len(BAND)],
        sample_profiles(spectrum(), BAND, WINDOW, SEED, [4]),
    )


def test_section_quadrature_is_exact_to_rounding():
    k = wavenumbers(1000.0)
    profiles = sample_profiles(spectrum(), k, 1000.0, SEED, range(4))
    x, weights = section_points(k, 200.0)
    assert np.sum(weights) == pytest.approx(1.0, rel=1e-13)
    nodes, fine = np.polynomial.legendre.leggauss(3 * len(x))
    heights = to_space(profiles, k, 100.0 * (nodes + 1.0))
    mean = heights @ fine / 2.0
    variance = ((heights - mean[:, None]) ** 2) @ fine / 2.0
    np.testing.assert_allclose(
        standard_deviation(profiles, k, 200.0), np.sqrt(variance), rtol=1e-11
    )


def test_rescaled_section_of_a_long_window():
    k = wavenumbers(1000.0)
    profiles = sample_profiles(spectrum(), k, 1000.0, SEED, range(4), sd=1.03e-3, section=200.0)
    np.testing.assert_allclose(standard_deviation(profiles, k, 200.0), 1.03e-3, rtol=1e-13)
    assert np.ptp(standard_deviation(profiles)) > 1e-5  # the whole window is left free


def test_section_follows_the_window():
    assert default_section(200.0) is None
    assert default_section(1000.0) == 200.0


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: spectrum("french"), "french.*fra_one_corner"),
        (lambda: spectrum("fra", 7), "fra_class is 7"),
        (lambda: profile_modes(200.0, 35.0, 3.0), "shortest below the longest"),
        (lambda: profile_modes(4.0, 3.0, 3.5), "no wave of a 4.0 m window"),
        (lambda: section_points(BAND, 0.0), "section is 0.0"),
        (
            lambda: standard_deviation(np.ones((1, 2), complex), None, 200.0),
            "needs the wavenumbers",
        ),
        (lambda: sample_profiles(spectrum(), BAND, WINDOW, -1, [0]), "seed is -1"),
        (lambda: sample_profiles(spectrum(), BAND, WINDOW, 0, [2**64]), "realisation index"),
        (lambda: sample_profiles(spectrum(), BAND, WINDOW, 0, [0], sd=0.0), "sd is 0.0"),
    ],
)
def test_refusals_say_why(call, words):
    with pytest.raises(InputError, match=words):
        call()


def test_no_realisations_is_an_empty_array():
    assert sample_profiles(spectrum(), BAND, WINDOW, 0, []).shape == (0, len(BAND))
