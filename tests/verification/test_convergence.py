"""The convergence study: its answers are those of the response, its orders those of known errors."""

import numpy as np
import pytest

from mcsettle.railway.track import CASE_STUDY_TRACK
from mcsettle.step_a.fem25d import MeshSettings, Settings, section_response
from mcsettle.step_a.fem25d.pml import Border
from mcsettle.verification import convergence
from mcsettle.verification.convergence import (
    OMEGAS,
    SPEED,
    Level,
    Numerics,
    answers,
    convergence_table,
)

MESH = MeshSettings(size=0.3, growth=1.5, largest=1.5, border=Border(elements=7))


@pytest.mark.slow
def test_answers_are_those_of_the_response():
    """By direct solutions and by reduced bases (tolerance 5e-3); both stop at 4 rad/m.

    Polynomials through 24 wavenumbers miss the compliance near the Rayleigh line by up to 2 %.
    """
    settings = Settings(
        mesh=MESH, max_omega=80.0, max_speed=SPEED, bands=(0.05, 0.4, 1.5, 4.0), tolerance=5e-3
    )
    found = answers(CASE_STUDY_TRACK, Numerics(MESH, count=24, largest=4.0))
    response = section_response(CASE_STUDY_TRACK, settings=settings, use_cache=False)
    constant, *driven = response.spectra(SPEED, np.array([0.0, *OMEGAS]))
    under = np.sum(constant.weights * constant.receptance).real / (2.0 * np.pi)
    assert found["deflection"] == pytest.approx(under, rel=2e-3)
    vertical = np.einsum("q,qz->z", constant.weights, constant.stress[:, 2]).real / (2.0 * np.pi)
    first = int(np.flatnonzero(response.grid.layer == 2)[0])
    assert found["stress, subgrade"] == pytest.approx(vertical[first], rel=2e-3)
    for omega, spectra in zip(OMEGAS, driven, strict=True):
        own = np.sum(spectra.weights * spectra.receptance) / (2.0 * np.pi)
        assert found[f"compliance, {omega:.0f} rad/s"] == pytest.approx(own, rel=0.03)


def test_orders_of_known_errors():
    sizes = (0.24, 0.17, 0.12)
    for order in (2.0, 3.5):
        values = [1.0 + 0.3 * h**order for h in sizes]
        assert convergence._order(sizes, values) == pytest.approx(order, abs=0.01)
    assert convergence._order(sizes, [1.0, 1.1, 1.3]) is None


def test_table_marks_the_defaults_and_names_are_checked():
    levels = [Level("size", "0.2", False, {"deflection": 1e-3}, 2.1),
              Level("size", "0.1", True, {"deflection": 2e-4, "stress": 1e-3})]  # fmt: skip
    lines = [[c.strip() for c in line.strip("|").split("|")] for line in
             convergence_table(levels).splitlines()]  # fmt: skip
    assert lines[0] == ["choice", "level", "deflection", "stress", "order"]
    assert set(lines[1][0]) == {"-"}
    assert lines[2] == ["size", "0.2", "1.0e-03", "", "2.1"]
    assert lines[3] == ["size", "0.1 (default)", "2.0e-04", "1.0e-03", ""]
    with pytest.raises(ValueError, match="choose from"):
        convergence.study_convergence(choices=("mesh",))


def test_a_study_goes_on_where_it_stopped(tmp_path, monkeypatch):
    monkeypatch.setenv("MCSETTLE_CACHE", str(tmp_path))
    asked, said = [], []

    def made_up(track, numerics):
        asked.append(numerics)
        return {"deflection": 1.0 + numerics.largest, "stress, ballast": 2.0 + 1j}

    monkeypatch.setattr(convergence, "answers", made_up)
    name = "largest wavenumber [rad/m]"
    first = convergence.study_convergence(choices=(name,), progress=lambda *s: said.append(s))
    assert len(asked) == 3
    assert said == [("Convergence", n, 3) for n in (1, 2, 3)]
    assert convergence.study_convergence(choices=(name,)) == first
    assert len(asked) == 3
    assert [level.default for level in first] == [False, True]
    assert first[0].changes["deflection"] == pytest.approx(8.0 / 13.0)
    assert first[0].changes["stress, ballast"] == 0.0
    # Another choice shares its default level, no more.
    convergence.study_convergence(choices=("wavenumbers",))
    assert len(asked) == 5
