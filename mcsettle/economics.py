"""What a change of speed or tonnage costs: present value, elasticity, marginal cost, Eqs. (4)–(9).

Intervals are in years of 365 days, money in any currency. A change of traffic during the first
tamping interval brings every later tamping forward by the same time; the marginal cost is the
derivative of the present value with respect to the first interval, the later ones held, times the
change of that interval by Eq. (7). An elasticity keeps its sign: more traffic that shortens the
interval has a negative elasticity and a positive marginal cost.

If settlement depends on the number of passages alone (more of the same trains) the interval times
the tonnage is constant, and the elasticity is −1/(1 + Δq/q) whatever the track: an identity.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mcsettle.errors import InputError
from mcsettle.units import DAYS_PER_YEAR

Number = float | np.ndarray

PER_SPEED, PER_TONNAGE = "per km/h per 1000 train-km", "per 1000 tonne-km"
_BEYOND = np.geomspace(1.0, 100.0, 200)  # horizons, over which a censored baseline is tried


def perpetual_present_value(
    tamping_cost: Number, discount_rate: Number, interval: Number
) -> np.ndarray:
    """Present value of tamping now and at constant intervals for ever, Eq. (4).

    Parameters
    ----------
    tamping_cost : float or ndarray, currency/track-km
    discount_rate : float or ndarray, 1/year; at 0 the sum has no end and the value is infinite
    interval : float or ndarray, years

    Returns
    -------
    ndarray, currency/track-km.

    Examples
    --------
    >>> float(perpetual_present_value(5625.0, 0.035, 2.0).round(2))
    83202.45
    """
    rate_years = np.asarray(discount_rate, dtype=float) * interval
    with np.errstate(divide="ignore"):
        return np.asarray(tamping_cost / np.abs(np.expm1(-rate_years)))


def present_value_slope(
    tamping_cost: Number, discount_rate: Number, interval: Number, observed: Number = 0.0
) -> np.ndarray:
    """∂PVC/∂T of Eq. (6), the first interval moved and the later ones held at the same length.

    Parameters
    ----------
    tamping_cost : float or ndarray, currency/track-km
    discount_rate : float or ndarray, 1/year; at 0 the limit −c/T is returned
    interval : float or ndarray, years
    observed : float or ndarray, years

    Returns
    -------
    ndarray, currency/track-km per year, negative: a later tamping is a cheaper one.
    """
    rate, years = np.broadcast_arrays(
        np.asarray(discount_rate, dtype=float), np.asarray(interval, dtype=float)
    )
    growth = np.expm1(rate * years)
    # r / (e^{rT} − 1) without 0/0 where there is no discounting.
    factor = np.divide(rate, growth, out=np.asarray(1.0 / years), where=growth != 0.0)
    return np.asarray(-tamping_cost * np.exp(rate * observed) * factor)


def elasticity(
    base_interval: Number, interval: Number, base_driver: Number, driver: Number
) -> np.ndarray:
    """Deterioration elasticity γ = (T₂/T₁ − 1) / ((q₂ − q₁)/q₁), for speed and for tonnage.

    Parameters
    ----------
    base_interval, interval : float or ndarray, any unit of time
    base_driver, driver : float or ndarray
        Speed or tonnage without and with the change, in the same unit.

    Returns
    -------
    ndarray, dimensionless.

    Examples
    --------
    >>> float(elasticity(697.0, 620.0, 201.0, 209.0).round(2))
    -2.78
    """
    change = (driver - base_driver) / base_driver
    return np.asarray((interval / base_interval - 1.0) / change)


def marginal_cost(
    elasticity: Number,
    base_interval: Number,
    tamping_cost: Number,
    discount_rate: Number,
    divisor: Number,
    observed: Number = 0.0,
) -> np.ndarray:
    """Marginal cost of tamping, Eqs. (8) and (9): −γ c r e^{r t̃} / (e^{rT} − 1) / d.

    Parameters
    ----------
    elasticity : float or ndarray
    base_interval : float or ndarray, years
        T of the baseline.
    tamping_cost : float or ndarray, currency/track-km
    discount_rate : float or ndarray, 1/year
    divisor : float or ndarray
        d, the yearly quantity the cost is spread over; it sets the unit of the result
        (``Change.divisor``).
    observed : float or ndarray, years

    Returns
    -------
    ndarray, currency per unit of ``divisor`` per year and track-km.
    """
    slope = present_value_slope(tamping_cost, discount_rate, base_interval, observed)
    return np.asarray(slope * elasticity / divisor)


def cost_exponent(discount_rate: float, interval: float) -> float:
    """The power d log(cost)/d log T that ``marginal_cost`` goes as at one elasticity: Eq. (7) by T.

    ``interval`` T in years, ``discount_rate`` r in 1/year; −r T / (1 − e^{−rT}), and −1 where r T is 0.
    """
    product = discount_rate * interval
    return -1.0 if product == 0.0 else -product / -math.expm1(-product)


@dataclass(frozen=True)
class Change:
    """What the scenario changes: the driver without and with it, and what the cost is spread over.

    ``base`` and ``changed`` share a unit; ``divisor`` is d of Eqs. (8) and (9) and ``unit`` the
    unit of the marginal cost that follows from it.
    """

    effect: Literal["speed", "tonnage"]
    base: float
    changed: float
    divisor: float
    unit: str

    def __post_init__(self) -> None:
        for name in ("base", "changed", "divisor"):
            value = getattr(self, name)
            if not 0.0 < value < np.inf:
                raise InputError(f"{self.effect} effect: {name} is {value}; it must be positive")
        if self.base == self.changed:
            raise InputError(
                f"{self.effect} effect: both scenarios have {self.base}; "
                "an elasticity needs a scenario that differs from its baseline"
            )


def speed_change(
    base_kmh: float, changed_kmh: float, trains_thousand_per_year: float, currency: str = "GBP"
) -> Change:
    """Change of linespeed [km/h]; the cost is per km/h, at the *new* speed, per 1000 train-km.

    Raises
    ------
    InputError
        If a number is not positive or the speeds are equal.
    """
    divisor = changed_kmh * trains_thousand_per_year
    return Change("speed", base_kmh, changed_kmh, divisor, f"{currency} {PER_SPEED}")


def tonnage_change(
    base_mgt_per_day: float,
    changed_mgt_per_day: float,
    changed_mgt_per_year: float | None = None,
    currency: str = "GBP",
) -> Change:
    """Change of tonnage [MGT/day]; the cost is per 1000 tonne-km of the *new* yearly tonnage.

    ``changed_mgt_per_year`` defaults to 365 days of the changed traffic.

    Raises
    ------
    InputError
        If a number is not positive or the tonnages are equal.
    """
    if changed_mgt_per_year is None:
        changed_mgt_per_year = DAYS_PER_YEAR * changed_mgt_per_day
    thousand_tonnes = 1e3 * changed_mgt_per_year
    unit = f"{currency} {PER_TONNAGE}"
    return Change("tonnage", base_mgt_per_day, changed_mgt_per_day, thousand_tonnes, unit)


@dataclass(frozen=True)
class Effects:
    """A scenario against its baseline, realisation by realisation, each array of shape [R].

    ``status`` is ``paired`` where both intervals are known, ``censored`` where one of them ran into
    its horizon, ``at_limit`` where the track was at its limit before any traffic, ``failed`` where one
    has no result. ``reduction_percent`` 100 (1 − T₂/T₁), ``elasticity`` and ``marginal_cost`` (in the
    unit of ``change``) are NaN unless paired.
    """

    change: Change
    status: np.ndarray
    reduction_percent: np.ndarray
    elasticity: np.ndarray
    marginal_cost: np.ndarray


def paired_effects(
    base_days: np.ndarray,
    days: np.ndarray,
    base_censored_at: np.ndarray,
    censored_at: np.ndarray,
    change: Change,
    tamping_cost: Number = 5625.0,
    discount_rate: Number = 0.035,
) -> Effects:
    """Effect of a scenario in each realisation, from intervals on the same tracks.

    Parameters
    ----------
    base_days, days : ndarray, shape [R], days
        Tamping intervals of baseline and scenario, NaN where the limit was not reached.
    base_censored_at, censored_at : ndarray, shape [R], days
        Horizon where the limit was not reached, NaN elsewhere; NaN in both marks a failure.
    change : Change
    tamping_cost : float or ndarray [R], currency/track-km
    discount_rate : float or ndarray [R], 1/year

    Returns
    -------
    Effects

    Raises
    ------
    InputError
        If the arrays differ in length or an interval is negative.
    """
    arrays = [np.asarray(a, dtype=float) for a in (base_days, days, base_censored_at, censored_at)]
    if len({a.shape for a in arrays}) != 1 or any(np.any(a < 0.0) for a in arrays):
        raise InputError("paired intervals must be days, none negative, in arrays of equal length")
    rough = (arrays[0] == 0.0) | (arrays[1] == 0.0)
    first, second, first_limit, second_limit = (np.where(rough, np.nan, a) for a in arrays)
    gamma = elasticity(first, second, change.base, change.changed)
    cost = marginal_cost(gamma, first / DAYS_PER_YEAR, tamping_cost, discount_rate, change.divisor)
    failed = np.isnan(np.fmax(first, first_limit)) | np.isnan(np.fmax(second, second_limit))
    paired = ~np.isnan(first) & ~np.isnan(second)
    return Effects(
        change=change,
        status=np.where(
            rough, "at_limit", np.where(paired, "paired", np.where(failed, "failed", "censored"))
        ),
        reduction_percent=100.0 * (1.0 - second / first),
        elasticity=gamma,
        marginal_cost=cost,
    )


def highest_costs(
    base_days: np.ndarray,
    days: np.ndarray,
    base_censored_at: np.ndarray,
    censored_at: np.ndarray,
    change: Change,
    tamping_cost: Number = 5625.0,
    discount_rate: Number = 0.035,
) -> np.ndarray:
    """What the marginal cost of each pair can be at most, censored intervals lying beyond their horizon.

    Parameters
    ----------
    base_days, days, base_censored_at, censored_at, change, tamping_cost, discount_rate
        As for ``paired_effects``, shape [R] each.

    Returns
    -------
    ndarray, shape [R], in the unit of ``change``
        The cost itself where both intervals are known, NaN where a realisation failed. A change that
        lowers its driver (fewer tonnes, lower speed) has no such bound where the scenario is censored:
        infinite. From below nothing bounds the cost of a censored scenario.
    """
    paired = (base_days, days, base_censored_at, censored_at, tamping_cost, discount_rate)
    first, second, first_end, second_end, price, rate = np.broadcast_arrays(
        *(np.asarray(a, dtype=float) for a in paired)
    )
    shortest = _known(second, second_end)
    # The baseline may be any length beyond its horizon: the cost has one maximum there.
    stretch = np.where(np.isnan(first), _BEYOND[:, None], 1.0)
    years = _known(first, first_end) * stretch / DAYS_PER_YEAR
    later = np.where(np.isnan(second) & (change.changed < change.base), np.inf, shortest)
    gamma = elasticity(years * DAYS_PER_YEAR, later, change.base, change.changed)
    costs = marginal_cost(gamma, years, price, rate, change.divisor)
    return np.asarray(np.max(costs, axis=0))


def _known(days: np.ndarray, otherwise: Number) -> np.ndarray:
    """Days where known, and the value given otherwise."""
    return np.where(np.isnan(days), otherwise, days)
