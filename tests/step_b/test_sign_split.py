"""Services that only count or only settle, in the cycle jump."""

from dataclasses import replace

import numpy as np
import pytest
import toy

from mcsettle.railway.track import PowerLaw
from mcsettle.railway.traffic import Service
from mcsettle.step_b.case import Support
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.step_b.cycles import cycles_at, daily_weights
from mcsettle.step_b.engine import engine_for
from mcsettle.step_b.sign_split import joined_traffic, sign_split

ADDED = (("passenger", 30), ("freight", 40))


def days(case) -> np.ndarray:
    return CycleJump(case).run(toy.profiles(range(8)), np.zeros(0)).days


def test_flags_that_are_all_set_change_no_bit():
    case = toy.case(ADDED[:1])
    flagged = replace(case, counted=(True,), settling=(True,))
    run, same = (CycleJump(c).run(toy.profiles(range(4)), np.zeros(0)) for c in (case, flagged))
    for name in ("days", "amplitudes", "mean_settlement", "passages", "steps"):
        np.testing.assert_array_equal(getattr(run, name), getattr(same, name))


@pytest.mark.parametrize("cycles", ["shared", "per_vehicle"])
@pytest.mark.parametrize("place", [0, 1])
def test_a_service_that_neither_settles_nor_counts_is_absent(place, cycles):
    """Wherever it stands in the day."""
    flags = (False, True) if place == 0 else (True, False)
    services = (("freight", 40), ("passenger", 30)) if place == 0 else ADDED
    off = replace(toy.case(services, cycles=cycles), counted=flags, settling=flags)
    without = days(toy.case((("passenger", 30),), cycles=cycles))
    np.testing.assert_allclose(days(off), without, rtol=1e-12)


def test_flagged_cases_together_are_each_by_itself():
    """To the bit: counts, integration and limits are each case's own."""
    case, u = toy.case(ADDED), toy.profiles(range(5))
    flags = [
        ((True, True), (True, True)),
        ((True, False), (True, False)),
        ((True, False), (True, True)),
    ]
    cases = [replace(case, counted=c, settling=s) for c, s in flags]
    support = Support(factor=np.linspace(0.5, 2.0, 5))
    together = CycleJump(case).run_flagged(cases, u, support)
    for one, found in zip(cases, together, strict=True):
        alone = CycleJump(one).run(u, np.zeros(0), support=support)
        for name in ("days", "amplitudes", "mean_settlement", "passages", "steps", "sd_initial"):
            np.testing.assert_array_equal(getattr(found, name), getattr(alone, name))


def test_hardening_alone_is_n_that_counts_more():
    """The growth of the others is that of a count that runs faster."""
    case = replace(toy.case((("car", 30), ("car", 60))), settling=(True, False))
    faster = toy.case((("car", 30),), cycles_per_passage=3.0, settlement_factor=toy.FACTOR / 3.0)
    day = np.array([3.5, 40.5])
    weights = daily_weights(case, day)
    n = len(case.model.group_laws)
    np.testing.assert_array_equal(weights[:, n:], 0.0)
    np.testing.assert_allclose(weights[:, :n], daily_weights(faster, day), rtol=1e-12)
    np.testing.assert_allclose(days(case), days(faster), rtol=1e-5)


def test_roughening_alone_leaves_the_count():
    case = toy.case(ADDED)
    alone = replace(case, counted=(True, False))
    n = len(case.model.group_laws)
    np.testing.assert_allclose(
        cycles_at(alone, np.array([20.0]))[:n], cycles_at(toy.case(ADDED[:1]), np.array([20.0]))
    )


def test_identical_trains_split_into_a_sooner_and_a_later_tamping():
    """One more of 72 trains: days times 72/73; by its cycles alone later, by its axles alone sooner."""
    services = (("car", 72), ("car", 1))
    every = (True, True)
    base, both = days(toy.case(services[:1])), days(replace(toy.case(services), counted=every))
    np.testing.assert_allclose(both / base, 72 / 73, rtol=1e-5)
    later = days(replace(toy.case(services), settling=(True, False)))
    sooner = days(replace(toy.case(services), counted=(True, False)))
    assert (sooner < both).all()
    assert (both < base).all()
    assert (base < later).all()


def test_a_law_linear_in_n_does_not_harden():
    laws = tuple(PowerLaw(1e-3, 0.9999, 2.0, 1e5) if law is not None else None for law in toy.LAWS)
    case = toy.case((("car", 72), ("car", 20)), laws=laws, horizon=1e5)
    base = days(replace(case, counted=(True, False), settling=(True, False)))
    np.testing.assert_allclose(days(replace(case, settling=(True, False))), base, rtol=1e-3)


def test_updates_passage_by_passage_refuse_the_flags():
    case = replace(toy.case(ADDED), counted=(True, False))
    with pytest.raises(ValueError, match="cycle_jump"):
        engine_for(case, "every_axle")


@pytest.mark.parametrize("flags", [(True,), (False, False)])
def test_flags_are_one_a_service_and_not_all_off(flags):
    with pytest.raises(ValueError, match="2 services"):
        replace(toy.case(ADDED), counted=flags)


def split(base, other, **changes):
    """The split of the change from the services ``base`` to ``other`` on 6 tracks."""
    sides = [
        [(Service(toy.TRAINS[t], toy.SPEEDS[t], n), toy.transfer(t)) for t, n in services]
        for services in (base, other)
    ]
    traffic = joined_traffic(*sides)
    names = [(s.train.name, s.per_day) for s in traffic.timetable.services]
    return traffic, sign_split(toy.case(names, **changes), traffic, toy.profiles(range(6)))


def test_what_is_kept_added_and_removed():
    base, other = (("passenger", 72), ("car", 5)), (("freight", 2), ("passenger", 73))
    traffic, _ = split(base, other)
    runs = [(s.train.name, s.per_day) for s in traffic.timetable.services]
    assert runs == [("freight", 2), ("passenger", 72), ("passenger", 1), ("car", 5)]
    assert traffic.before == (False, True, False, True)
    assert traffic.after == (True, True, True, False)
    assert traffic.added == 2 * 12 + 12


@pytest.mark.parametrize("cycles", ["shared", "per_vehicle"])
def test_an_identical_train_roughens_as_one_of_the_baseline(cycles):
    """ξ = 1 and the interval times 72/73, whatever the count."""
    _, found = split((("car", 72),), (("car", 73),), cycles=cycles)
    np.testing.assert_allclose(found.reduction, 100.0 / 73.0, rtol=1e-4)
    np.testing.assert_allclose(found.roughening, 1.0, atol=2e-3)


def test_break_even_is_that_of_the_law():
    """One law N^b in all layers: ξ* = 1 − φ′(N)(N − N₀)/(φ(N) − φ(N₀)) at the end of the interval."""
    b, services = 0.16, (("car", 72),)
    laws = tuple(None if law is None else PowerLaw(0.3, b, 2.0, 1e5) for law in toy.LAWS)
    _, found = split(services, (("car", 90),), laws=laws, settlement_factor=60.0)
    end = days(toy.case(services, laws=laws, settlement_factor=60.0))[:6]
    assert np.isfinite(end).all()
    n = 1e5 + 72 * 4 * end
    expected = 1.0 - b * n ** (b - 1.0) * (n - 1e5) / (n**b - 1e5**b)
    np.testing.assert_allclose(found.break_even, expected, rtol=1e-5)
    np.testing.assert_allclose(found.leverage, 1.0 / (1.0 - expected), rtol=1e-5)


def test_a_law_linear_in_n_has_no_break_even():
    laws = tuple(None if law is None else PowerLaw(1e-3, 0.9999, 2.0, 1e5) for law in toy.LAWS)
    _, found = split((("car", 72),), (("car", 90),), laws=laws, horizon=1e5)
    np.testing.assert_allclose(found.break_even, 0.0, atol=1e-3)
    np.testing.assert_allclose(found.by_hardening, 0.0, atol=0.1)
    np.testing.assert_allclose(found.by_roughening, found.reduction, atol=0.1)


def test_per_vehicle_counting_hardens_nobody_else():
    _, found = split((("passenger", 30),), ADDED, cycles="per_vehicle")
    np.testing.assert_allclose(found.by_hardening, 0.0, atol=1e-3)
    assert np.isnan(found.break_even).all()
    assert (found.reduction > 0.0).all()


def test_the_sign_turns_where_an_axle_roughens_less_than_the_break_even():
    _, found = split((("freight", 40),), (("freight", 40), ("car", 40)))
    assert np.isfinite(found.roughening).all()
    np.testing.assert_array_equal(
        found.reduction > 0.0, found.roughening > found.break_even, strict=True
    )


def test_a_replaced_train_changes_no_count():
    """All trains replaced by others with as many axles: nothing hardens; ξ is the ratio of growths."""
    _, found = split((("passenger", 20),), (("freight", 20),))
    np.testing.assert_allclose(found.by_hardening, 0.0, atol=1e-3)
    np.testing.assert_allclose(found.by_roughening, found.reduction, atol=1e-3)


def test_what_outlives_the_horizon_is_not_split():
    _, found = split((("car", 72),), (("car", 73),), horizon=1.0)
    assert np.isnan(found.reduction).all()
    assert np.isnan(found.leverage).all()
