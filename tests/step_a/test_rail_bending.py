"""The rail's bending against a beam of finite elements on springs, and what it does to stresses."""

import numpy as np
import pytest
import toy

from mcsettle.railway.irregularity import wavenumbers
from mcsettle.step_a.interaction import precompute
from mcsettle.step_a.rail_bending import rail_bending, with_rail_bending
from mcsettle.step_a.transfer_file import load, save


def beam_on_springs(bending, support, settled, n, length):
    """Deflection [n] of a periodic beam on a settled Winkler support, cubic elements."""
    h = length / n
    beam = bending / h**3 * np.array(
        [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2],
         [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h**2, -6 * h, 4 * h**2]]
    )  # fmt: skip
    mass = h / 420 * np.array(
        [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2],
         [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2]]
    )  # fmt: skip
    stiffness, foundation = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, 2 * n))
    for i in range(n):
        at = np.array([2 * i, 2 * i + 1, 2 * ((i + 1) % n), 2 * ((i + 1) % n) + 1])
        stiffness[np.ix_(at, at)] += beam
        foundation[np.ix_(at, at)] += support * mass
    return np.linalg.solve(stiffness + foundation, foundation @ settled)[::2]


@pytest.mark.parametrize("wave", [3.0, 6.0, 15.0])
def test_a_beam_of_finite_elements(wave):
    """H and the force that moves, −EI k⁴ U, on a Winkler support."""
    track, n = toy.response().track, 240
    k = 2.0 * np.pi / wave
    x = np.arange(n) * wave / n
    settled = np.stack([np.cos(k * x), -k * np.sin(k * x)], axis=1).ravel()
    bending, support = track.rail.bending_stiffness, track.support_stiffness
    rail = beam_on_springs(bending, support, settled, n, wave)
    found = rail_bending(toy.response(), np.array([k]))
    np.testing.assert_allclose(rail, found.following[0] * np.cos(k * x), atol=1e-7)
    force = support * (rail - np.cos(k * x))
    np.testing.assert_allclose(force, -bending * k**4 * rail, atol=1e-6 * np.abs(force).max())


def test_the_stress_of_the_beam_track_in_closed_form():
    """−2 EI k⁴ times the stress of a unit reaction, whatever the support."""
    response, k = toy.response(), wavenumbers(200.0)
    found = rail_bending(response, k)
    bending, support = response.track.rail.bending_stiffness, response.track.support_stiffness
    np.testing.assert_allclose(found.following, support / (support + bending * k**4), rtol=1e-12)
    at = int(np.argmin(np.abs(response.wavenumbers - k[30])))
    same = rail_bending(response, response.wavenumbers[at : at + 1])
    kernel = response.kernel[at].conj()
    expected = -2.0 * bending * response.wavenumbers[at] ** 4 * kernel
    np.testing.assert_allclose(same.stress[0], expected, atol=1e-12 * np.abs(expected).max())
    # Under a hollow (profile positive down) the standing load is less: tension is added to σzz.
    assert (found.stress[:, 2].real > 0.0).all()
    assert np.abs(found.stress[:, :3].imag).max() == 0.0
    assert np.abs(found.stress[:, 3].real).max() == 0.0


def test_a_share_of_it_in_the_transfer_functions(tmp_path):
    """The dynamic stress of every axle, kept on disk with what the rail follows."""
    transfer, response = toy.transfer(), toy.response()
    bent = with_rail_bending(transfer, response, response, 0.5, "0" * 64)
    found = rail_bending(response, transfer.wavenumbers)
    for axle in (0, 7):
        np.testing.assert_allclose(
            bent.dynamic[axle] - transfer.dynamic[axle], 0.5 * found.stress,
            atol=1e-9 * np.abs(transfer.dynamic).max(),
        )  # fmt: skip
    save(bent, tmp_path / "bent.npz")
    again = load(tmp_path / "bent.npz")
    np.testing.assert_array_equal(again.following, found.following)
    save(transfer, tmp_path / "plain.npz")
    assert load(tmp_path / "plain.npz").following is None


def test_the_whole_load_on_each_rail():
    """Twice the receptance and the stress of a standing load; other transfer functions."""
    modes, response = toy.transfer("car", shortest=20.0).wavenumbers, toy.response()
    half, whole = (
        precompute(toy.TRAINS["car"], toy.SPEEDS["car"], response, modes, whole=w)
        for w in (False, True)
    )
    np.testing.assert_allclose(whole.quasi_static, 2.0 * half.quasi_static, rtol=1e-12)
    np.testing.assert_allclose(whole.track_compliance, 2.0 * half.track_compliance, rtol=1e-12)
    assert whole.digest != half.digest
    assert half.digest == toy.transfer("car", shortest=20.0).digest
