"""Marginal costs in the units of access charges: per gross tonne-km, train-km and vehicle-km.

The marginal train of a scenario is the one that runs more often there than in the baseline; with
tonnage as the driver its cost per train-km is its mass times the cost per tonne-km. With speed as
the driver it is the train of the baseline, and its cost is the marginal cost per km/h times the
difference of the speeds.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mcsettle.estimate.estimate import Estimate
from mcsettle.report.money import symbol
from mcsettle.report.words import mostly_known
from mcsettle.study.study import Study
from mcsettle.summary.summary import SummaryRow
from mcsettle.units import TONNE

if TYPE_CHECKING:
    from mcsettle.report.material import Material

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


@dataclass(frozen=True)
class Charge:
    """One marginal cost in one unit: ``factor`` times what ``row`` holds."""

    effect: str
    unit: str
    row: SummaryRow
    factor: float

    @property
    def mean(self) -> Estimate | None:
        """Mean over the sections: what a line of many sections costs; None where not known."""
        rows = [*self.row.spread, *self.row.statistics]
        found = (s.estimate for s in rows if s.statistic in ("section_mean", "mean"))
        return next(found, None)


def marginal_train(study: Study, effect: str) -> MarginalTrain | None:
    """The train that the effect adds or makes faster; None where it is not a single one."""
    found = study.effects.get(effect)
    if found is None:
        return None
    before = _services(study, found.baseline)
    after = _services(study, found.scenario)
    if found.change.effect == "speed":
        if found.train is not None:
            before, after = (
                {key: n for key, n in side.items() if key[0] == found.train}
                for side in (before, after)
            )
        names = {name for name, _ in after}
        if len(names) != 1 or {name for name, _ in before} != names:
            return None
        return _train(study, *next(iter(after)), base=next(iter(before))[1])
    changes = {key: after.get(key, 0) - before.get(key, 0) for key in {*before, *after}}
    moved = {key: n for key, n in changes.items() if n}
    if len(moved) != 1 or next(iter(moved.values())) < 0:
        return None
    (key, more), *_ = moved.items()
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
    found = [PriceUnit(f"km/h per 1000 train-{length}" if speed else tonne, km)]
    if train is None:
        return found
    each = train.mass / 1000.0
    if train.base_speed is not None:
        each = (train.speed - train.base_speed) / 1000.0
        found.append(PriceUnit(tonne, 1e3 * each / train.mass * km))
    found.append(PriceUnit(f"train-{length}", each * km))
    found.append(PriceUnit(f"vehicle-{length}", each / train.cars * km))
    return found


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
    found: dict[str, list[str]] = {}
    for name in names:
        found.setdefault(headline_unit(study, name, miles).label, []).append(name)
    return list(found.values())


def charges(material: "Material", effect: str) -> list[Charge]:
    """The marginal cost of an effect in every unit that it has; none of a minority of the tracks."""
    row = material.row(effect, "marginal_cost")
    if row is None or not mostly_known(row):
        return []
    units = price_units(material.study, effect, material.miles)
    sign = symbol(material.study.currency).strip()
    return [Charge(effect, f"{sign} per {unit.label}", row, unit.factor) for unit in units]


def _services(study: Study, scenario: str) -> dict[tuple[str, float], int]:
    """Trains a day by name and speed [km/h]."""
    found: dict[tuple[str, float], int] = {}
    for entry in study.scenario(scenario).timetable:
        key = (entry.train, entry.speed_kmh)
        found[key] = found.get(key, 0) + entry.per_day
    return found


def _train(
    study: Study, name: str, speed: float, more: int = 0, base: float | None = None
) -> MarginalTrain:
    train = study.trains[name]
    mass = train.mass / TONNE
    return MarginalTrain(name, len(train.cars), mass, mass / train.n_axles, speed, more, base)
