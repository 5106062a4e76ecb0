"""Filters of records: gains, phases, and what they do to a standard deviation."""

import numpy as np
import pytest

from mcsettle.errors import InputError
from mcsettle.railway.filters import D1, Band, band_passed, sd_ratio, versine_loss
from mcsettle.railway.spectra import fra, spectrum

STEP = 0.25
X = np.arange(0.0, 2000.0, STEP)
INNER = slice(1200, -1200)


@pytest.mark.parametrize("wavelength", [2.0, 3.5, 8.0, 20.0, 30.0, 45.0, 90.0])
@pytest.mark.parametrize("band", [Band(), Band(3.0, 35.0, "butterworth", 4), Band(*D1)])
def test_a_wave_comes_through_by_the_gain_and_without_phase(band: Band, wavelength: float) -> None:
    k = 2.0 * np.pi / wavelength
    passed = band_passed(np.sin(k * X), STEP, band)[INNER]
    gain = float(band.gain(np.array([k]))[0])
    # The digital Butterworth's edges are warped a little; the ideal band's sharp edges ring far.
    atol = 0.012 if band.kind == "butterworth" else 0.05
    np.testing.assert_allclose(passed, gain * np.sin(k * X)[INNER], atol=atol)


def test_butterworth_is_6_db_down_at_both_edges() -> None:
    for order in (2, 3, 4, 8):
        band = Band(3.0, 35.0, "butterworth", order)
        edges = 2.0 * np.pi / np.array([3.0, 35.0])
        np.testing.assert_allclose(band.gain(edges), 0.5, rtol=1e-12)


@pytest.mark.parametrize(("order", "ratio"), [(2, 0.907), (3, 0.920), (4, 0.933)])
def test_effect_on_the_sd_by_order(order: int, ratio: float) -> None:
    """The ratio by quadrature, and that of a synthesised record run through the filter."""
    band = Band(3.0, 35.0, "butterworth", order)
    assert sd_ratio(band, spectrum("fra"), Band()) == pytest.approx(ratio, abs=5e-4)
    rng = np.random.default_rng(2)
    k = 2.0 * np.pi * np.arange(1, 2001) / 2000.0  # waves of 1 to 2000 m
    size = np.sqrt(spectrum("fra")(k) * 2.0 * np.pi / 2000.0)
    ratios = []
    for _ in range(12):
        coefficients = np.zeros(len(X) // 2 + 1, dtype=complex)
        coefficients[1:2001] = size * (rng.normal(size=2000) + 1j * rng.normal(size=2000))
        coefficients[1:20] = 0.0  # what a levelling car does not see either
        level = np.fft.irfft(coefficients, len(X)) * len(X) / 2.0
        own, ideal = (band_passed(level, STEP, b)[INNER].std() for b in (band, Band()))
        ratios.append(own / ideal)
    error = np.std(ratios, ddof=1) / np.sqrt(len(ratios))
    assert abs(np.mean(ratios) - ratio) < 4.0 * error + 2e-3


def test_d1_of_the_published_spectra() -> None:
    """SD of 3–25 m over SD of 3–35 m, FRA and German shapes."""
    assert sd_ratio(Band(*D1), spectrum("fra"), Band()) == pytest.approx(0.745, abs=1e-3)
    assert sd_ratio(Band(*D1), spectrum("german_low"), Band()) == pytest.approx(0.786, abs=1e-3)


def test_what_cannot_be_filtered_is_refused() -> None:
    with pytest.raises(InputError, match="cannot carry waves of 3 m"):
        band_passed(np.zeros(1000), 1.3, Band())
    with pytest.raises(InputError, match="need at least 70 m"):
        band_passed(np.zeros(100), 0.25, Band())
    with pytest.raises(InputError, match="lengths must be positive and rise"):
        Band(35.0, 3.0)
    with pytest.raises(InputError, match="'chebyshev' is unknown"):
        Band(kind="chebyshev")
    with pytest.raises(InputError, match="order 0"):
        Band(order=0)


def test_what_a_chord_does_not_show() -> None:
    """Versines of 10 and 20 m: blind at L/2, L/4, …; the shares of an FRA spectrum are in the docs."""
    for chord, share, blind in ((10.0, 0.0070, (5.0,)), (20.0, 0.0349, (10.0, 5.0, 20.0 / 6.0))):
        lost, waves = versine_loss(chord, Band(), lambda k: fra(k, 1.0))
        assert lost == pytest.approx(share, abs=5e-4)
        assert waves == pytest.approx(blind)
