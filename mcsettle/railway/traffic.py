"""Traffic: trains of cars, services at a speed, and the timetable as one ordered day.

Positions along a train are positive forward with the leading axle at 0, so every other axle has a
negative position and axle passages happen in the order of the arrays.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mcsettle.railway.vehicle import Vehicle
from mcsettle.units import GRAVITY


@dataclass(frozen=True)
class Train:
    """Cars coupled in order, leading car first."""

    name: str
    cars: tuple[Vehicle, ...]

    def __post_init__(self) -> None:
        if not self.cars:
            raise ValueError(f"train '{self.name}' has no cars")

    def __str__(self) -> str:
        return f"{self.name}: {len(self.cars)} cars, {self.n_axles} axles, {self.mass / 1e3:.0f} t"

    @property
    def axle_positions(self) -> np.ndarray:
        """Axle positions [m], shape [J], leading axle at 0, falling."""
        front = 0.0
        positions = []
        for car in self.cars:
            centre = front - car.length / 2.0
            positions += [centre + offset for offset in car.axle_offsets]
            front -= car.length
        return np.asarray(positions) - positions[0]

    @property
    def axle_forces(self) -> np.ndarray:
        """Static wheelset forces [N], shape [J], positive on the track."""
        return np.array([load * GRAVITY for car in self.cars for load in car.loads])

    @property
    def n_axles(self) -> int:
        """Number of wheelsets."""
        return sum(car.n_axles for car in self.cars)

    @property
    def mass(self) -> float:
        """Gross mass [kg]: axle loads summed."""
        return float(sum(sum(car.loads) for car in self.cars))

    @property
    def description(self) -> dict[str, Any]:
        """All that decides its dynamics, as digests take it: what is usual of a vehicle is left out."""
        described = asdict(self)
        for car in described["cars"]:
            for name, usual in (("axles_per_bogie", 2), ("bodies", 1)):
                if car[name] == usual:
                    del car[name]
        return described


@dataclass(frozen=True)
class Service:
    """A train that runs ``per_day`` times a day at ``speed`` [m/s], in one block of the timetable."""

    train: Train
    speed: float
    per_day: int

    def __post_init__(self) -> None:
        if not 0.0 < self.speed < np.inf:
            raise ValueError(
                f"speed of '{self.train.name}' is {self.speed} m/s; it must be positive"
            )
        if self.per_day < 1:
            raise ValueError(f"'{self.train.name}' runs {self.per_day} times a day; at least 1")


@dataclass(frozen=True)
class Timetable:
    """One ordered day: the services run one after the other, then the day repeats."""

    services: tuple[Service, ...]

    def __post_init__(self) -> None:
        if not self.services:
            raise ValueError("the timetable is empty; it needs at least one service")

    def __str__(self) -> str:
        return "; ".join(
            f"{s.per_day} × {s.train.name} at {s.speed * 3.6:.0f} km/h" for s in self.services
        )

    @property
    def passages_per_day(self) -> int:
        """Axle passages per day."""
        return sum(s.per_day * s.train.n_axles for s in self.services)

    @property
    def trains_per_day(self) -> int:
        """Trains per day."""
        return sum(s.per_day for s in self.services)

    @property
    def mass_per_day(self) -> float:
        """Gross mass per day [kg]."""
        return float(sum(s.per_day * s.train.mass for s in self.services))
