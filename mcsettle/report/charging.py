"""Marginal costs in the units of access charges: per gross tonne-km, train-km and vehicle-km.

The marginal train of a scenario is the one that runs more often there than in the baseline; with
tonnage as the driver its cost per train-km is its mass times the cost per tonne-km. With speed as
the driver it is the train of the baseline, and its cost is the marginal cost per km/h times the
difference of the speeds.
"""

from collections import Counter
from dataclasses import dataclass

from mcsettle.study.study import Study
from mcsettle.units import TONNE

KM_PER_MILE = 1.609344


@dataclass(frozen=True)
class MarginalTrain:
    """The train whose cost a scenario shows: ``mass`` t, ``axle_load`` t, ``speed`` km/h.

    ``more`` a day, or at another speed than ``base_speed``.
    """

    name: str
    cars: int
    mass: float
    axle_load: float
    speed: float
    more: int = 0
    base_speed: float | None = None


def marginal_train(study: Study, name: str) -> MarginalTrain | None:
    """The train that the effect ``name`` adds or makes faster; None where it is not a single one."""
    effect = study.effects.get(name)
    if effect is None:
        return None
    before, after = (_services(study, side) for side in (effect.baseline, effect.scenario))
    if effect.change.effect == "speed":
        old, new = ([s for s in side if effect.train in (None, s[0])] for side in (before, after))
        names = {name for name, _ in new}
        if len(names) != 1 or {name for name, _ in old} != names:
            return None
        return _train(study, *new[0], base=old[0][1])
    moved = {key: n for key in {*before, *after} if (n := after[key] - before[key])}
    if len(moved) != 1 or next(iter(moved.values())) < 0:
        return None
    ((key, more),) = moved.items()
    return _train(study, *key, more=more)


@dataclass(frozen=True)
class PriceUnit:
    """What a marginal cost is per: ``label``, and the factor from the unit of the study's effects."""

    label: str
    factor: float


def price_units(study: Study, effect: str, miles: bool = False) -> list[PriceUnit]:
    """The units that the marginal cost of an effect has, its own first."""
    change, train = study.change(effect), marginal_train(study, effect)
    if change is None:
        return []
    km, length = (KM_PER_MILE, "mile") if miles else (1.0, "km")
    tonne = f"1000 gross tonne-{length}"
    speed = change.effect == "speed"
    units = [PriceUnit(f"km/h per 1000 train-{length}" if speed else tonne, km)]
    if train is None:
        return units
    each = train.mass / 1000.0
    if train.base_speed is not None:
        each = (train.speed - train.base_speed) / 1000.0
        units.append(PriceUnit(tonne, 1e3 * each / train.mass * km))
    units.append(PriceUnit(f"train-{length}", each * km))
    units.append(PriceUnit(f"vehicle-{length}", each / train.cars * km))
    return units


def headline_unit(study: Study, effect: str, miles: bool = False) -> PriceUnit:
    """The unit a price is asked in: of a train for a speed, of tonnes for tonnage.

    In a study with effects of both kinds, of a train for each of them.
    """
    units = price_units(study, effect, miles)
    speed = any(e.change.effect == "speed" for e in study.effects.values())
    by_train = (unit for unit in units if speed and unit.label.startswith("train-"))
    return next(by_train, units[0])


def by_unit(study: Study, names: list[str], miles: bool = False) -> list[list[str]]:
    """Effects whose prices are asked in one unit, and so stand on one axis; in their order."""
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(headline_unit(study, name, miles).label, []).append(name)
    return list(groups.values())


def _services(study: Study, scenario: str) -> Counter[tuple[str, float]]:
    """Trains a day by name and speed [km/h]."""
    per_day: Counter[tuple[str, float]] = Counter()
    for entry in study.scenario(scenario).timetable:
        per_day[entry.train, entry.speed_kmh] += entry.per_day
    return per_day


def _train(
    study: Study, name: str, speed: float, more: int = 0, base: float | None = None
) -> MarginalTrain:
    train = study.trains[name]
    mass = train.mass / TONNE
    return MarginalTrain(name, len(train.cars), mass, mass / train.n_axles, speed, more, base)
