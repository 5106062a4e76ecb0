"""A march that is put down and taken up again; its arithmetic in single precision."""

import numpy as np
import pytest
import toy

from mcsettle.step_b.engine import engine_for
from mcsettle.step_b.expansion_error import worst_error
from mcsettle.step_b.stepwise import MarchState, Stepwise

DAYS = np.array([0.0, 0.25, 0.75])


@pytest.mark.parametrize("side", ["spectral", "pointwise"])
def test_a_march_goes_on_to_the_last_bit(side):
    """From any launch: amplitudes, uniform settlement, counts and history as without a pause."""
    case = toy.case(shortest=8.0, horizon=1.0)
    start, states = toy.profiles(range(3), shortest=8.0), list[MarchState]()
    start[1] *= 1.4999 / 1.03  # reaches the limit on the way
    engine = Stepwise(case, "every_axle", side)
    march = engine.march(start, DAYS)
    for _ in march:
        states.append(march.state())
    whole = march.outcome()
    assert whole.reached.tolist() == [False, True, False]
    for state in (states[0], states[len(states) // 2]):
        march = engine.march(start, DAYS, state)
        for _ in march:
            pass
        rest = march.outcome()
        for name in ("amplitudes", "mean_settlement", "passages", "days", "history"):
            np.testing.assert_array_equal(getattr(rest, name), getattr(whole, name))


@pytest.mark.parametrize("stepping", ["every_axle", "every_train"])
def test_single_precision_errs_by_its_own_digits(stepping):
    """The growth of each update has some 1e-6 of rounding, which neither biases nor adds up."""
    case, start = toy.case(horizon=3.0), toy.profiles(range(70))
    outcomes = [engine_for(case, stepping, precision=p).run(start, DAYS) for p in ("f64", "f32")]
    grown = [outcome.amplitudes - start for outcome in outcomes]
    off = np.abs(grown[1] - grown[0]).max(axis=1) / np.abs(grown[0]).max(axis=1)
    assert 1e-9 < off.max() < 2e-6
    np.testing.assert_allclose(outcomes[1].mean_settlement, outcomes[0].mean_settlement, rtol=1e-7)


def test_single_precision_at_every_x_and_depth():
    """The same, with the power's own series; not to the tracks' state, which stays double."""
    case, start = toy.case(shortest=8.0, horizon=1.0), toy.profiles(range(70), shortest=8.0)
    engines = [engine_for(case, "every_axle", "pointwise", precision=p) for p in ("f64", "f32")]
    outcomes = [engine.run(start, DAYS) for engine in engines]
    grown = [outcome.amplitudes - start for outcome in outcomes]
    off = np.abs(grown[1] - grown[0]).max(axis=1) / np.abs(grown[0]).max(axis=1)
    assert 1e-9 < off.max() < 1e-5
    np.testing.assert_allclose(outcomes[1].mean_settlement, outcomes[0].mean_settlement, rtol=1e-6)


@pytest.mark.parametrize("side", ["spectral", "pointwise"])
def test_single_precision_is_refused_where_there_is_none(side):
    with pytest.raises(ValueError, match="precision 'f32' takes"):
        engine_for(toy.case(shortest=8.0), "cycle_jump", side, precision="f32")
    with pytest.raises(ValueError, match="precision 'f16'"):
        engine_for(toy.case(shortest=8.0), "cycle_jump", side, precision="f16")


def test_the_expansion_is_checked_at_the_limit_too():
    """Third order: relative error in proportion to the square of the SD, 1.03 to 1.5 mm."""
    case, start = toy.case(), toy.profiles(range(2))
    from mcsettle.step_b.expansion_error import expansion_error

    assert worst_error(case, start) == pytest.approx(
        expansion_error(case, start * (1.5 / 1.03)), rel=1e-9
    )
    assert worst_error(case, start * 2.0) == pytest.approx(expansion_error(case, start * 2.0))
