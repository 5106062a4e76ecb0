"""Step B whole: steppings against each other, closed forms and an independent integrator.

``toy.FACTOR`` = 300 makes settlement 300 times quicker, so that the limit comes within a month.
"""

from dataclasses import replace

import numpy as np
import pytest
import toy
from scipy.integrate import solve_ivp

from mcsettle.railway.irregularity import standard_deviation, wavenumbers
from mcsettle.step_b.case import Case
from mcsettle.step_b.cycle_jump import TOLERANCE, CycleJump
from mcsettle.step_b.cycles import daily_weights
from mcsettle.step_b.engine import engine_for, foreseen_passages
from mcsettle.step_b.mode_pairs import mode_pairs
from mcsettle.step_b.passage import in_band, mode_numbers, settlement_of_passage
from mcsettle.step_b.settlement import cycle_increment, cycle_rate
from mcsettle.step_b.spectral import growth, train_form
from mcsettle.step_b.stepwise import Stepwise

MIXED = (("passenger", 30), ("freight", 40))
AXLES_PER_DAY = 72 * 12
DAYS = np.array([0.0, 5.0, 10.0, 20.0])


@pytest.fixture(scope="module")
def exact():
    """Every axle of every train until the limit, 16 realisations."""
    return engine_for(toy.case(), "every_axle").run(toy.profiles(range(16)), DAYS)


@pytest.fixture(scope="module")
def jump():
    return engine_for(toy.case()).run(toy.profiles(range(16)), DAYS)


def test_cycle_jump_is_every_axle(exact, jump):
    """The difference is one of counting, not of physics: about an axle passage in 28 000.

    Passage by passage the limit is found at the end of an update (half an update late on average),
    and explicit updates lag a continuous growth by ½ ln(1.5/1.03) = 0.2 updates. The axles of a
    train do not settle alike while the jump spreads them evenly: ± the train's own 12 axles at most.
    """
    assert exact.days.min() > 20
    assert exact.days.max() < 60
    assert np.abs(jump.days / exact.days - 1).max() < 2e-3
    late = (exact.days - jump.days) * AXLES_PER_DAY
    assert np.abs(late).max() < 3.0
    np.testing.assert_allclose(jump.history, exact.history, rtol=2e-5)
    np.testing.assert_allclose(jump.mean_settlement, exact.mean_settlement, rtol=2e-4)
    np.testing.assert_array_equal(exact.passages, np.rint(exact.days * AXLES_PER_DAY))
    assert np.all((exact.sd_final >= toy.SD_LIMIT) & (exact.sd_final < toy.SD_LIMIT + 1e-7))
    np.testing.assert_allclose(jump.sd_final, toy.SD_LIMIT, rtol=1e-6)


def test_every_train_is_every_axle_to_a_train(exact):
    trains = engine_for(toy.case(), "every_train").run(toy.profiles(range(16)), DAYS)
    late = (trains.days - exact.days) * 72
    assert np.all((late > -1.0) & (late < 2.0))
    np.testing.assert_array_equal(trains.passages % 12, 0)
    # a profile frozen over a train lags by ½ ln(1.5/1.03) = 0.2 trains of some 2400
    np.testing.assert_allclose(trains.history, exact.history, rtol=2e-4)


def test_a_passage_at_a_time_is_what_passage_says():
    """One day of a car at one axle an update, against ``passage`` from first principles."""
    case = toy.case((("car", 2), ("freight", 1)), shortest=8.0, laws=toy.QUADRATIC_LAWS)
    case = replace(case, horizon=2.0)
    start = toy.profiles(range(2), shortest=8.0)
    outcome = engine_for(case, "every_axle").run(start, np.zeros(0))
    modes = mode_numbers(case.transfers[0].wavenumbers, case.window)
    for row, u in enumerate(start):
        done, uniform = 0, 0.0
        for _day in range(2):
            for service, transfer in zip(case.timetable.services, case.transfers, strict=True):
                for axle in list(range(service.train.n_axles)) * service.per_day:
                    settlement = settlement_of_passage(
                        u, axle, transfer, case.model, toy.cycles(case.model, done), case.window
                    )
                    u = u + in_band(settlement, modes)
                    uniform += settlement.mean()
                    done += 1
        assert outcome.passages[row] == done == 40
        grown = np.abs(u - start[row]).max()
        # the second-order form is exact for these laws: rounding of 40 updates
        assert np.abs(outcome.amplitudes[row] - u).max() < 1e-10 * grown
        assert outcome.mean_settlement[row] == pytest.approx(uniform, rel=1e-12, abs=0.0)


def test_an_independent_integrator_agrees():
    """SciPy's eighth-order method in days, the form in NumPy, the limit as its event: 1e-6."""
    jump = engine_for(toy.case(), tolerance=1e-7).run(toy.profiles([3]), np.zeros(0))
    case, pairs = toy.case(), mode_pairs(np.arange(6, 67))
    form = train_form(case.transfers[0], case.model, pairs)
    start = toy.profiles([3])[0]

    def slope(day, y):
        cycles = 1e5 + AXLES_PER_DAY * day
        weights = [72 * toy.FACTOR * cycle_rate(law, cycles) for law in case.model.group_laws]
        return growth(form, y.view(complex), np.array([weights]), pairs)[0][0].view(float)

    def limit(day, y):
        return np.sqrt(0.5 * y @ y) - toy.SD_LIMIT

    limit.terminal = True
    path = solve_ivp(
        slope, (0.0, 100.0), start.view(float).copy(), "DOP853", events=limit, rtol=1e-11,
        atol=1e-16,
    )  # fmt: skip
    assert jump.days[0] == pytest.approx(path.t_events[0][0], rel=1e-6)
    np.testing.assert_allclose(
        jump.amplitudes[0], path.y_events[0][0].view(complex), atol=1e-6 * toy.SD
    )


def test_identical_trains_make_a_day_of_passages(jump):
    """Damage depends on the passage count alone, so days × trains a day is constant.

    The elasticity is then (72/73 − 1)/(1/72) = −72/73 whatever the track: an identity.
    """
    more = engine_for(toy.case((("passenger", 73),))).run(toy.profiles(range(16)), np.zeros(0))
    # the two runs differ in the scale of time only: both are right to the integrator's 1e-7
    np.testing.assert_allclose(more.days * 73, jump.days * 72, rtol=1e-6)
    elasticity = (more.days / jump.days - 1) * 72
    np.testing.assert_allclose(elasticity, -72 / 73, atol=1e-4)


def test_identical_trains_take_the_same_passages():
    """Passage by passage the same updates in the same order: the same count, to the last one."""
    counts = [
        engine_for(toy.case((("car", n),), shortest=8.0, settlement_factor=3e4), "every_axle")
        .run(toy.profiles(range(8), shortest=8.0), np.zeros(0))
        .passages
        for n in (10, 13)
    ]
    np.testing.assert_array_equal(*counts)
    assert counts[0].min() > 200


@pytest.mark.parametrize(("stepping", "tolerance"), [("cycle_jump", 2e-6), ("every_axle", 2e-4)])
def test_small_profiles_grow_wave_by_wave(stepping, tolerance):
    """U_k(N) = U_k(0) exp(Σ_g L_gk ΔΦ_g): a nanometre of roughness, 20 days.

    The quadratic terms are 1e-6 of what they are at a millimetre. The jump adds its own 1e-7 a step;
    passage by passage Π(1 + a_i) lags exp(Σ a_i) by Σ a_i²/2, here 1.85²/2/17 280 = 1e-4 at most.
    """
    case = toy.case((("passenger", 72),), sd_limit=1.0, horizon=20.0)
    start = toy.profiles(range(2), sd=1e-9)
    outcome = engine_for(case, stepping, tolerance=1e-7).run(start, np.zeros(0))
    form = train_form(case.transfers[0], case.model, mode_pairs(np.arange(6, 67)))
    grown = [cycle_increment(law, 1e5, 20 * AXLES_PER_DAY) for law in case.model.group_laws]
    exponent = toy.FACTOR * np.array(grown) / 12 @ form.linear  # the form sums 12 axles
    assert 1.5 < np.abs(exponent).max() < 2.0
    ratio = outcome.amplitudes / (start * np.exp(exponent))
    assert np.abs(ratio - 1).max() < tolerance
    assert not outcome.reached.any()


def test_days_converge_with_the_tolerance():
    case, profiles = toy.case(MIXED), toy.profiles(range(8))

    def days(tolerance):
        return engine_for(case, tolerance=tolerance).run(profiles, np.zeros(0)).days

    best = days(1e-12)
    errors = [np.abs(days(t) / best - 1).max() for t in (1e-3, 1e-5, TOLERANCE, 1e-7)]
    assert errors[0] < 3e-2
    assert errors[1] < errors[0] / 10
    assert errors[2] < 1e-5  # the default: far below the half day that a table shows
    assert errors[3] < errors[1] / 10
    assert errors[3] < 1e-6


@pytest.mark.parametrize("stepping", ["cycle_jump", "every_axle", "every_train"])
def test_out_of_time_is_censored(stepping):
    """A horizon before some limits: those rows have no days, a whole history and all passages."""
    case = toy.case(shortest=8.0, horizon=1.0, settlement_factor=1.6e4)
    samples = np.array([0.0, 0.25, 0.5, 1.0])
    outcome = engine_for(case, stepping).run(toy.profiles(range(30), shortest=8.0), samples)
    late = ~outcome.reached
    assert late.any()
    assert outcome.reached.any()
    assert not outcome.failed.any()
    assert np.isnan(outcome.days[late]).all()
    assert np.isfinite(outcome.history[late]).all()
    np.testing.assert_array_equal(outcome.passages[late], AXLES_PER_DAY)
    assert np.all(outcome.sd_final[late] < toy.SD_LIMIT)
    np.testing.assert_allclose(outcome.history[late, -1], outcome.sd_final[late], rtol=1e-9)
    assert np.all(outcome.days[~late] <= 1.0)
    assert np.isnan(outcome.history[~late, -1]).all() or outcome.days[~late].max() == 1.0
    np.testing.assert_allclose(outcome.sd_initial, toy.SD, rtol=1e-12)


@pytest.mark.parametrize("stepping", ["cycle_jump", "every_axle"])
def test_sampling_does_not_change_the_run(stepping):
    case = toy.case(shortest=8.0, settlement_factor=9e3)
    engine, profiles = engine_for(case, stepping), toy.profiles(range(10), shortest=8.0)
    few, many = np.array([0.0, 0.5, 3.0]), np.linspace(0.0, 3.0, 13)
    a, b = engine.run(profiles, few), engine.run(profiles, many)
    np.testing.assert_array_equal(a.days, b.days)
    np.testing.assert_array_equal(a.amplitudes, b.amplitudes)
    # a finer history may cut the samples out of another interpolant's rounding, not more
    np.testing.assert_allclose(a.history, b.history[:, [0, 2, 12]], rtol=1e-13)
    for row, end in enumerate(b.days):
        before = many <= end
        assert np.isfinite(b.history[row, before]).all()
        assert np.isnan(b.history[row, ~before]).all()
        assert np.all(b.history[row, before] < toy.SD_LIMIT)
        assert b.history[row, before][-1] > 1.1 * toy.SD
    np.testing.assert_allclose(b.history[:, 0], toy.SD, rtol=1e-12)


def test_total_stress_settles_more(jump):
    """The geostatic part shares the sign of the quasi-static one: more mean settlement, fewer days."""
    total = engine_for(toy.case(stress="total")).run(toy.profiles(range(16)), DAYS)
    assert total.reached.all()
    assert np.all(total.mean_settlement / total.days > 2 * jump.mean_settlement / jump.days)
    assert np.all(total.days < 0.9 * jump.days)


@pytest.mark.parametrize("cycles", ["shared", "per_vehicle"])
def test_mixed_traffic_passage_by_passage(cycles):
    """After whole days the jump is the march, whichever way N is counted.

    A shared N is met at the middle of each service's block: an error of second order in a day's share
    of N, (420/1e5)²/12 of the growth, is far below the day's own discreteness, one train in 70.
    """
    case = toy.case(MIXED, cycles=cycles, horizon=12.0, settlement_factor=60.0)
    profiles, days = toy.profiles(range(7)), np.array([1.0, 3.0, 10.0])
    exact = engine_for(case, "every_axle").run(profiles, days)
    jump = engine_for(case).run(profiles, days)
    grown = exact.history - toy.SD
    assert np.abs((jump.history - exact.history) / grown).max() < 1e-3
    np.testing.assert_allclose(jump.sd_final, exact.sd_final, rtol=1e-5)
    np.testing.assert_allclose(jump.mean_settlement, exact.mean_settlement, rtol=5e-5)


@pytest.mark.parametrize("cycles", ["shared", "per_vehicle"])
def test_mixed_traffic_reaches_the_limit_within_the_same_day(cycles):
    """The crossing day keeps the timetable's order: off by the 3 passages of identical trains.

    Read as an averaged day it would be ahead by up to 360 of the day's 840 passages (measured: 342),
    because freight, which fills the last 480, does most of the damage.
    """
    case = toy.case(MIXED, cycles=cycles, settlement_factor=120.0)
    profiles = toy.profiles(range(7))
    exact = engine_for(case, "every_axle").run(profiles, np.zeros(0))
    jump = engine_for(case).run(profiles, np.zeros(0))
    assert exact.days.min() > 10
    late = exact.days - jump.days
    assert np.all(np.abs(late) < 3 / 840)
    freight_share = np.floor(exact.days) + 360 / 840
    assert np.all(exact.days > freight_share)  # it is freight that takes these tracks to the limit


def test_a_track_at_its_limit_before_any_mixed_traffic_is_tamped_on_day_0():
    case = toy.case(MIXED, settlement_factor=120.0)
    rough = 2.0 * case.sd_limit / toy.SD * toy.profiles(range(3))
    for stepping in ("cycle_jump", "every_axle"):
        outcome = engine_for(case, stepping).run(rough, np.zeros(1))
        assert outcome.reached.all()
        np.testing.assert_array_equal(outcome.days, 0.0)


def test_counting_per_vehicle_settles_more():
    """Each vehicle meets fewer cycles N when it counts alone, and φ' falls with N.

    Over 40 days shared N grows from 1e5 to 1.34e5, own ones to 1.14e5 and 1.19e5.
    """
    settled = [
        engine_for(toy.case(MIXED, cycles=cycles, horizon=40.0, settlement_factor=1.0))
        .run(toy.profiles(range(4)), np.zeros(0))
        .mean_settlement
        for cycles in ("shared", "per_vehicle")
    ]
    assert np.all(settled[1] > 1.02 * settled[0])
    assert np.all(settled[1] < 1.15 * settled[0])


def test_the_order_of_the_day_is_kept():
    """Freight first or last: the march tells them apart by less than 1 %, and the jump likewise.

    Few cycles before, so that the first service of the first day meets a much lower N.
    """
    few = {"ballast_cycles_before": 2e4, "subgrade_cycles_before": 2e4}
    settled = {}
    for name, services in (("first", MIXED[::-1]), ("last", MIXED)):
        for stepping in ("every_axle", "cycle_jump"):
            case = toy.case(services, horizon=3.0, sd_limit=1.0, settlement_factor=10.0, **few)
            outcome = engine_for(case, stepping).run(toy.profiles([0]), np.zeros(0))
            settled[name, stepping] = outcome.mean_settlement[0]
    exact = settled["first", "every_axle"] / settled["last", "every_axle"] - 1
    jump = settled["first", "cycle_jump"] / settled["last", "cycle_jump"] - 1
    assert 1e-4 < abs(exact) < 1e-2
    assert jump == pytest.approx(exact, rel=0.05, abs=0.0)


def test_daily_weights_are_a_day_of_increments():
    """dφ at the middle of each block, against the block's own telescoped increments: 2nd order."""
    case = toy.case(MIXED, ballast_cycles_before=1e4, subgrade_cycles_before=1e4)
    weights = daily_weights(case, np.array([0.5, 30.5]))
    for row, day in enumerate((0, 30)):
        gone = day * 840
        blocks = [(gone, 360, 12), (gone + 360, 480, 12)]
        expected = [
            toy.FACTOR * cycle_increment(law, 1e4 + start, axles) / per_train
            for start, axles, per_train in blocks
            for law in case.model.group_laws
        ]
        # relative error (block/N)²/12 of a second derivative of order 1: 480/1e4 gives 2e-4
        np.testing.assert_allclose(weights[row], expected, rtol=5e-4)


def test_a_factor_for_each_realisation_is_the_models():
    profiles = toy.profiles(range(3))
    case = toy.case(settlement_factor=1.0)
    outcome = CycleJump(case).run(profiles, DAYS, np.array([200.0, 300.0, 400.0]))
    for row, factor in enumerate((200.0, 300.0, 400.0)):
        alone = engine_for(toy.case(settlement_factor=factor)).run(profiles[row : row + 1], DAYS)
        # the same steps; the factor is multiplied in at another place: rounding
        assert outcome.days[row] == pytest.approx(alone.days[0], rel=1e-10)
        np.testing.assert_allclose(outcome.history[row], alone.history[0], rtol=1e-10)


def test_pointwise_right_hand_side_agrees():
    """Every x and depth: exact for exponents 2, within the expansion's error for the published."""
    profiles = toy.profiles(range(3), shortest=12.0)
    for laws, tolerance in ((toy.QUADRATIC_LAWS, 1e-8), (toy.LAWS, 3e-4)):
        case = toy.case((("car", 200),), shortest=12.0, laws=laws, settlement_factor=1e4)
        fast = engine_for(case).run(profiles, np.zeros(0))
        slow = engine_for(case, right_hand_side="pointwise").run(profiles, np.zeros(0))
        assert fast.reached.all()
        np.testing.assert_allclose(fast.days, slow.days, rtol=tolerance)
        np.testing.assert_allclose(fast.mean_settlement, slow.mean_settlement, rtol=tolerance)


def test_every_axle_at_every_x_and_depth():
    """Exact for exponents 2: the same passages, the same tracks at the end."""
    profiles = toy.profiles(range(3), shortest=12.0)
    for laws, tolerance in ((toy.QUADRATIC_LAWS, 1e-8), (toy.LAWS, 3e-4)):
        case = toy.case((("car", 200),), shortest=12.0, laws=laws, settlement_factor=1e4)
        fast = engine_for(case, "every_axle").run(profiles, DAYS[:1])
        slow = engine_for(case, "every_axle", "pointwise").run(profiles, DAYS[:1])
        assert fast.reached.all()
        np.testing.assert_allclose(fast.days, slow.days, rtol=tolerance, atol=1.01 / 800)
        np.testing.assert_allclose(fast.mean_settlement, slow.mean_settlement, rtol=1e-3)


def test_a_long_window_takes_the_sd_of_200_m():
    modes = {"window": 1000.0, "shortest": 6.0}
    case = toy.case((("car", 100),), settlement_factor=3e3, **modes)
    start = toy.profiles(range(4), **modes)
    samples = np.array([0.0, 1.0])
    outcome = engine_for(case).run(start, samples)
    np.testing.assert_allclose(outcome.sd_initial, toy.SD, rtol=1e-10)
    np.testing.assert_allclose(outcome.history[:, 0], toy.SD, rtol=1e-10)
    assert outcome.reached.all()
    # the SD at the stop by points along the first 200 m, not by the engine's own map
    x = np.linspace(0.0, 200.0, 200_001)
    k = wavenumbers(1000.0, 6.0)
    heights = np.real(np.exp(1j * np.outer(x, k)) @ outcome.amplitudes[0])
    assert heights.std() == pytest.approx(toy.SD_LIMIT, rel=1e-4)
    whole = standard_deviation(outcome.amplitudes)
    assert np.abs(whole / toy.SD_LIMIT - 1).max() > 0.01
    with pytest.raises(ValueError, match="below 400 m"):
        engine_for(case, "every_axle")


def test_realisations_over_the_limit_at_the_start_take_no_time():
    case = toy.case(shortest=8.0, settlement_factor=9e3)
    profiles = toy.profiles(range(3), sd=1.0, shortest=8.0) * np.array([[1e-3], [2e-3], [1.4e-3]])
    for stepping in ("cycle_jump", "every_axle"):
        outcome = engine_for(case, stepping).run(profiles, np.array([0.0]))
        assert outcome.reached.all()
        assert outcome.days[1] == 0.0
        assert outcome.passages[1] == 0
        assert np.all(outcome.days[[0, 2]] > 0.0)


def test_ticks_rise_to_the_end():
    case, profiles = toy.case(shortest=8.0, horizon=1.0), toy.profiles(range(2), shortest=8.0)
    passages = foreseen_passages(case, profiles)
    seen = [passages(day) for day in Stepwise(case).march(profiles, np.array([0.5]))]
    assert seen == sorted(seen)
    per_day = case.timetable.passages_per_day
    assert (per_day, 2 * per_day) in seen  # half a day of both tracks
    assert seen[-1] == (2 * per_day, 2 * per_day)


def test_impossible_combinations_are_refused():
    case = toy.case(shortest=8.0)
    with pytest.raises(ValueError, match="choose from"):
        engine_for(case, "sometimes")
    with pytest.raises(ValueError, match="choose from"):
        engine_for(case, right_hand_side="guess")
    with pytest.raises(ValueError, match="cycle_jump"):
        engine_for(case, "every_train", "pointwise")
    with pytest.raises(ValueError, match="one set of transfer functions per service"):
        Case(case.timetable, (), case.model, 200.0, 1.5e-3, 10.0)


def test_days_before_are_counts_that_begin_higher():
    """Each track its own days of traffic before day 0, in one engine; another engine for each count."""
    start, gone = toy.profiles(range(3)), np.array([0.0, 7.0, 40.0])
    case = toy.case()
    assert len({type(law) for law in case.model.group_laws}) == 2  # ballast and ground
    together = engine_for(case).run(start, DAYS, ground_days=0.5 * gone, ballast_days=gone)
    for row, days in enumerate(gone):
        counted = {
            "ballast_cycles_before": 1e5 + AXLES_PER_DAY * days,
            "subgrade_cycles_before": 1e5 + AXLES_PER_DAY * 0.5 * days,
        }
        alone = engine_for(toy.case(**counted)).run(start[[row]], DAYS)
        np.testing.assert_allclose(together.history[row], alone.history[0], rtol=1e-5)
        assert together.days[row] == pytest.approx(alone.days[0], rel=1e-4)
