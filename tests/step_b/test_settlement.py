"""Settlement laws: published values, identities in the number of cycles, no cancellation."""

from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcsettle.railway.settlement_model import SettlementModel
from mcsettle.railway.track import LEAN_CLAY, SUB_BALLAST, BallastLaw, PowerLaw
from mcsettle.step_b.settlement import cycle_increment, cycle_rate, strain_increment, strain_scale
from mcsettle.units import KPA

SILT = PowerLaw(0.64, 0.10, 1.70, 100 * KPA)
LAWS = [BallastLaw(), LEAN_CLAY.law, SUB_BALLAST.law, SILT]


@pytest.mark.parametrize(
    ("law", "stress_kpa", "expected"),
    [
        (BallastLaw(), 100.0, "4.5154e-04"),  # 0.375 · 0.1² · 0.4 log10 2
        (LEAN_CLAY.law, 20.0, "5.2098e-05"),  # 1.1/100 · (20/250)² · (2e5^0.16 − 1e5^0.16)
        (SILT, 20.0, "9.4166e-05"),
        (SUB_BALLAST.law, 60.0, "2.3146e-04"),
    ],
)
def test_strain_from_1e5_to_2e5_cycles(law, stress_kpa, expected):
    """Worked by hand from Eqs. (1) and (2) in their printed units (MPa, per cent)."""
    assert f"{strain_increment(law, stress_kpa * KPA, 1e5, 1e5):.4e}" == expected


@pytest.mark.parametrize("law", LAWS)
@given(
    start=st.floats(1.0, 1e8),
    parts=st.lists(st.floats(1e-3, 1e6), min_size=1, max_size=20),
)
def test_increments_telescope_over_any_split(law, start, parts):
    """The sum of the parts is the whole; rounding of N itself moves dN by ε N/dN of a part."""
    ends = start + np.cumsum(parts)
    starts = np.concatenate([[start], ends[:-1]])
    split = cycle_increment(law, starts, ends - starts).sum()
    whole = cycle_increment(law, start, ends[-1] - start)
    # ends − starts is exact (Sterbenz or an ulp); 20 additions of positive numbers: 1e-14.
    lost = 4 * np.finfo(float).eps * ends[-1] * len(parts) / (ends[-1] - start)
    assert split == pytest.approx(whole, rel=1e-13 + lost, abs=0.0)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("cycles", [10**5, 10**8])
def test_one_cycle_among_many_does_not_cancel(law, cycles):
    """Against 50-digit decimals. The plain difference, as a control, has lost half its digits."""
    with localcontext() as context:
        context.prec = 50
        n = Decimal(cycles)
        if isinstance(law, BallastLaw):
            slope = Decimal(law.log_slope)
            exact = float(slope * ((n + 1).log10() - n.log10()))
            plain = law.log_slope * (np.log10(cycles + 1.0) - np.log10(float(cycles)))
        else:
            b = Decimal(law.b)
            exact = float((b * (n + 1).ln()).exp() - (b * n.ln()).exp())
            plain = (cycles + 1.0) ** law.b - float(cycles) ** law.b
    assert float(cycle_increment(law, cycles, 1.0)) == pytest.approx(exact, rel=1e-14, abs=0.0)
    if cycles == 10**8:
        assert abs(plain / exact - 1.0) > 1e-9


@pytest.mark.parametrize("law", LAWS)
def test_rate_is_the_derivative(law):
    """Central differences: error (h/N)²·|φ'''|N²/6φ' < (h/N)² here, and second order in h."""
    n = np.logspace(0, 8, 9)
    error = []
    for h in (1e-2 * n, 1e-3 * n):
        difference = cycle_increment(law, n - h, 2 * h) / (2 * h)
        error.append(np.abs(difference / cycle_rate(law, n) - 1.0).max())
    assert error[1] < 1e-6
    assert np.log10(error[0] / error[1]) == pytest.approx(2.0, abs=0.01)


@pytest.mark.parametrize("law", LAWS)
@given(stress=st.floats(0.0, 1e7), cycles=st.floats(1.0, 1e9), more=st.floats(0.0, 1e9))
def test_strain_is_never_negative_and_grows_with_stress(law, stress, cycles, more):
    strain = strain_increment(law, [stress, 2.0 * stress], cycles, more)
    assert np.all(strain >= 0.0)
    assert strain[1] == pytest.approx(2.0**law.exponent * strain[0], rel=1e-12, abs=1e-300)


def test_strain_keeps_the_shape_of_its_arguments():
    strain = strain_increment(SILT, np.full((3, 1), 1e4), np.full(5, 1e5))
    assert strain.shape == (3, 5)


def test_model_names_its_groups():
    model = SettlementModel(
        (BallastLaw(), None, SILT), ballast_cycles_before=7.0, subgrade_cycles_before=9.0
    )
    assert model.settling_layers == (0, 2)
    assert model.group_laws == (BallastLaw(), SILT)
    assert [model.cycles_before(law) for law in model.group_laws] == [7.0, 9.0]
    assert strain_scale(BallastLaw()) == pytest.approx(0.375e-12, rel=1e-14, abs=0.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"stress": "none"}, "stress is 'none'"),
        ({"cycles": "none"}, "cycles is 'none'"),
        ({"laws": (None, None)}, "no layer"),
        ({"ballast_cycles_before": 0.0}, "at least 1"),
        ({"subgrade_cycles_before": np.nan}, "at least 1"),
        ({"cycles_per_passage": 0.0}, "must be positive"),
        ({"settlement_factor": np.inf}, "must be positive"),
    ],
)
def test_model_refuses(change, message):
    with pytest.raises(ValueError, match=message):
        SettlementModel(**{"laws": (SILT,), **change})
