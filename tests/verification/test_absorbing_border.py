"""The absorbing border: reflection falls with its elements; statics do not feel its angle."""

import math

import numpy as np
import pytest
from half_space import C_P, half_space

from mcsettle.step_a.fem25d.pml import Border, border_lengths
from mcsettle.step_a.fem25d.solve import outputs, solve

CASES = [(0.02, 5.0), (0.1, 60.0), (0.3, 150.0)]  # all ω > k c_P: body and surface waves


def responses(border: Border) -> np.ndarray:
    section = half_space(0.2, border)
    return np.array([outputs(section, k, solve(section, k, w)) for k, w in CASES])


def difference(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.abs(a - b)[:, 1:].max(axis=1) / np.abs(b[:, 1:]).max(axis=1)


def test_reflection_falls_with_the_number_of_elements():
    assert all(w > k * C_P for k, w in CASES)
    exact = responses(Border(elements=26, length=4000.0))
    coarse, middle, fine = (difference(responses(Border(elements=n)), exact) for n in (5, 9, 13))
    assert np.all(middle < 0.5 * coarse)
    assert np.all(fine < 0.5 * middle)
    assert np.all(fine < 5e-3)


@pytest.mark.parametrize("wavenumber", [0.005, 0.05, 0.5])
def test_statics_are_real_and_do_not_depend_on_the_angle(wavenumber):
    values = []
    for angle in (0.2, math.pi / 4.0):
        section = half_space(0.2, Border(angle=angle))
        values.append(outputs(section, wavenumber, solve(section, wavenumber, 0.0)))
    # The static field is analytic in the border's coordinate: only its discretisation is left.
    scale = np.array([np.abs(values[0][0]), *np.full(values[0].size - 1, abs(values[0][1:]).max())])
    assert np.all(np.abs(values[0] - values[1]) < 2e-3 * scale)
    z = (values[1].size - 1) // 4
    real = np.concatenate([values[1][:-z], 1j * values[1][-z:]])  # τxz is imaginary
    assert np.all(np.abs(real.imag) < 1e-3 * scale)


def test_border_lengths_add_up():
    lengths = border_lengths(0.5, Border(elements=9, length=300.0, angle=0.6, ramp=2))
    assert np.abs(lengths).sum() == pytest.approx(300.0)
    assert np.angle(lengths[0]) == pytest.approx(-0.3)
    assert np.angle(lengths[-1]) == pytest.approx(-0.6)


def test_border_refuses_nonsense():
    with pytest.raises(ValueError, match="at least 1"):
        Border(elements=0)
    with pytest.raises(ValueError, match="angle"):
        Border(angle=2.0)
