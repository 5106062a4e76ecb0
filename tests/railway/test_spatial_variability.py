"""The random field of susceptibility: its waves, its address, its distribution."""

from dataclasses import replace

import numpy as np
import pytest

from mcsettle.errors import InputError
from mcsettle.railway.irregularity import profile_modes, random_amplitudes
from mcsettle.railway.spatial_variability import (
    SpatialVariability,
    SupportVariation,
    field_waves,
    negative_share,
    section_factors,
    susceptibility,
    to_points,
)
from mcsettle.railway.spectra import spectrum

WINDOW, MODES = 200.0, profile_modes(200.0)
FRA = spectrum()
FIELD = SpatialVariability(0.2, 5.0, multipliers=(1.0, 1.0, 1.0))
BAND = slice(5, 66)


def drawn(settings, n=400, **changes):
    waves = field_waves(settings, MODES, WINDOW, FRA)
    return susceptibility(settings, waves, 1, range(n), [0, 1, 2], **changes)


@pytest.mark.parametrize(
    ("length", "share"), [(2.0, 0.80), (5.0, 0.70), (10.0, 0.55), (20.0, 0.405)]
)
def test_share_of_the_band_in_closed_form(length, share):
    """√((2/π)[atan(2.09 ℓ) − atan(0.18 ℓ)]) of an exponential field, between the band's wavenumbers."""
    closed = np.sqrt(2.0 / np.pi * (np.arctan(2.09 * length) - np.arctan(0.18 * length)))
    assert closed == pytest.approx(share, abs=0.015)
    waves = field_waves(replace(FIELD, correlation_length=length), MODES, WINDOW, FRA)
    k = 2.0 * np.pi * np.arange(1, 20_000) / WINDOW
    density = length / (1.0 + (k * length) ** 2)
    around_zero = 0.5 * length  # the half cell that no wave of the window stands for
    whole = np.sqrt(density[BAND].sum() / (density.sum() + around_zero))
    assert whole == pytest.approx(share, abs=0.01)
    few = np.sqrt(density[BAND].sum() / density[:132].sum())
    assert 1.0 / waves.point_share == pytest.approx(few, rel=1e-12)


def test_coefficient_of_variation_in_the_band():
    h = drawn(FIELD)[:, 0]
    band = 0.5 * np.sum(np.abs(h[:, BAND]) ** 2, axis=1)
    assert np.sqrt(band.mean()) == pytest.approx(0.2, rel=0.03)
    assert h.shape == (400, 132)


def test_tracks_stay_the_same_tracks():
    """The stream of the profile is what it was, and the field's is another."""
    old = np.random.Generator(np.random.Philox(key=np.array([7, 3], dtype=np.uint64)))
    expected = old.standard_normal((61, 2))
    found = random_amplitudes(7, 3, 61)
    np.testing.assert_array_equal(found, expected[:, 0] + 1j * expected[:, 1])
    other = [random_amplitudes(7, 3, 61, stream) for stream in ((1, 0), (2, 0), (2, 1), (3, 0))]
    for i, one in enumerate(other):
        for two in [found, *other[:i]]:
            assert not np.isin(one.real, two.real).any()


def test_an_address_alone_gives_its_field():
    many = drawn(FIELD, 5)
    waves = field_waves(FIELD, MODES, WINDOW, FRA)
    alone = susceptibility(FIELD, waves, 1, [3], [0, 1, 2])
    np.testing.assert_array_equal(alone[0], many[3])


@pytest.mark.parametrize("rho", [-1.0, 0.0, 0.6, 1.0])
def test_coherence_with_the_profile(rho):
    """Wave by wave in the band; waves outside it have numbers of their own."""
    h = drawn(replace(FIELD, profile_correlation=rho))[:, 0]
    g = np.stack([random_amplitudes(1, i, 61) for i in range(400)])
    scale = 0.2 * field_waves(FIELD, MODES, WINDOW, FRA).scale[BAND]
    coherence = np.mean(h[:, BAND] / scale * g.conj()).real / 2.0
    assert coherence == pytest.approx(rho, abs=0.02)
    np.testing.assert_array_equal(h[:, 66:], drawn(FIELD)[:, 0, 66:])


def test_layers_and_independent_fields():
    layered = replace(FIELD, multipliers=(1.0, 0.5, 0.0))
    np.testing.assert_array_equal(layered.coupling([0, 1, 2]), [[1.0, 0.5, 0.0]])
    np.testing.assert_array_equal(layered.coupling([0]), [[1.0, 0.0, 0.0]])
    apart = replace(layered, independent=True)
    np.testing.assert_array_equal(apart.coupling([0, 1, 2]), [[1.0, 0.0, 0.0], [0.0, 0.5, 0.0]])
    h = drawn(apart)
    assert h.shape[1] == 2
    alike = np.mean(h[:, 0, BAND] * h[:, 1, BAND].conj()).real / np.mean(np.abs(h[:, 0, BAND]) ** 2)
    assert abs(alike) < 0.05
    # A layer's field is its own whatever the others are.
    second = replace(FIELD, multipliers=(0.0, 0.5, 0.0), independent=True)
    np.testing.assert_array_equal(drawn(second, 3)[:, 0], drawn(apart, 3)[:, 1])


@pytest.mark.parametrize(("cov", "point", "kept"), [(0.29, 0.4, 0.963), (0.58, 0.8, 0.879)])
def test_lognormal_fields(cov, point, kept):
    """Positive, of the coefficient asked for in the band, and a little less like the profile.

    At a point the correlation with the exponent is σ/√(e^σ² − 1), σ² = log(1 + coefficient²).
    """
    h = drawn(replace(FIELD, cov=cov, distribution="lognormal"), 1000)[:, 0]
    band = 0.5 * np.sum(np.abs(h[:, BAND]) ** 2, axis=1)
    assert np.sqrt(band.mean()) == pytest.approx(cov, rel=0.05)
    here, exponent = (to_points(field[:200], 2048) for field in (h, drawn(FIELD, 200)[:, 0]))
    assert np.mean(here > -1.0) > 0.999
    assert here.std() == pytest.approx(point, rel=0.07)
    assert np.mean(here * exponent) / (here.std() * exponent.std()) == pytest.approx(
        kept, abs=0.015
    )


def test_a_coefficient_that_no_lognormal_field_has():
    with pytest.raises(InputError, match="at most"):
        drawn(replace(FIELD, cov=5.0, distribution="lognormal"), 1)


def test_a_reference_sd_makes_it_proportional_to_the_initial_sd():
    sd = np.array([1e-3, 2e-3])
    h = drawn(replace(FIELD, reference_sd=1e-3), 2, initial_sd=sd)
    np.testing.assert_allclose(h[0], drawn(FIELD, 1)[0], rtol=1e-14)
    np.testing.assert_allclose(h[1], 2.0 * drawn(FIELD, 2)[1], rtol=1e-14)


def test_persistence_across_a_tamping():
    first = drawn(FIELD)
    np.testing.assert_array_equal(drawn(FIELD, tamping=4), first)
    fading = replace(FIELD, persistence=0.7)
    later = drawn(fading, tamping=2)
    alike = np.mean(first * later.conj()).real / np.mean(np.abs(first) ** 2)
    assert alike == pytest.approx(0.49, abs=0.03)
    assert np.mean(np.abs(later) ** 2) == pytest.approx(np.mean(np.abs(first) ** 2), rel=0.05)


def test_sections_that_differ():
    factors = section_factors(1, range(4000), 0.4)
    assert np.median(factors) == pytest.approx(1.0, abs=0.03)
    assert np.std(np.log(factors)) == pytest.approx(0.4, rel=0.04)
    variation = SupportVariation(section_log_sd=0.4)
    fields, same = variation.sample(1, range(4000), np.ones(4000))
    assert fields is None
    np.testing.assert_array_equal(same, factors)
    assert SupportVariation().sample(1, range(3), np.ones(3)) == (None, None)


def test_the_share_of_a_negative_susceptibility():
    assert negative_share(0.0) == 0.0
    assert negative_share(0.3) == pytest.approx(4.3e-4, rel=0.01)
