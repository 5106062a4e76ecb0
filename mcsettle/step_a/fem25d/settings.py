"""Numerical settings of Step A: mesh, range, reduced basis, quadrature."""

from dataclasses import asdict, dataclass
from typing import Any

from mcsettle.errors import check_positive
from mcsettle.step_a.fem25d.pml import Border
from mcsettle.step_a.fem25d.section import MeshSettings

WIDE_BANDS = (0.1, 0.5, 1.5, 12.0)  # rad/m


@dataclass(frozen=True)
class Settings:
    """All numerical choices behind a section response.

    The response is available for speeds up to ``max_speed`` [m/s] and driving frequencies up to
    ``max_omega`` [rad/s]: the basis is trained on ω ≤ max_omega + k max_speed for k up to the last
    of ``bands`` [rad/m]. ``tolerance`` ends the growth of a basis: error at its worst points, and the
    largest change of an output by the last extension; elsewhere it is mostly below a seventh of that.
    ``panel`` [rad/m] is the longest quadrature panel for k < 3 rad/m, fit for distances up to about
    12/(panel/2) m. ``held_out`` points per band check the basis and change nothing.
    """

    mesh: MeshSettings = MeshSettings()
    max_omega: float = 160.0
    max_speed: float = 75.0
    bands: tuple[float, ...] = (0.01, 0.025, 0.06, 0.15, 0.4, 0.8, 1.5, 3.0, 5.0, 8.0, 12.0)
    tolerance: float = 1e-2
    max_solves: int = 60
    panel: float = 0.045
    panel_points: int = 12
    held_out: int = 3

    def __post_init__(self) -> None:
        if list(self.bands) != sorted(set(self.bands)) or not self.bands or self.bands[0] <= 0.0:
            raise ValueError(f"wavenumber bands are {self.bands}; they must be positive and rising")
        for name in ("max_omega", "max_speed", "tolerance", "panel"):
            check_positive(name, getattr(self, name))
        if self.panel_points < 2 or self.max_solves < 3:
            raise ValueError(
                f"panel_points is {self.panel_points} and max_solves {self.max_solves}; "
                "at least 2 and 3 are needed"
            )
        if self.held_out < 1:
            raise ValueError(f"held_out is {self.held_out}; at least 1 is needed")

    @property
    def description(self) -> dict[str, Any]:
        """All that a response depends on: everything but the points that check it."""
        found = asdict(self)
        del found["held_out"]
        return found


def many_grounds_settings(max_speed: float, max_omega: float, softens: bool) -> Settings:
    """Settings for one ground of many, each of them alike and none looked at alone.

    Four wide bands, eight points a panel and a mesh that grows faster away from the track, much faster on
    soil that does not soften. What that does to stresses, days and effects, ``studies/many_grounds.py``
    measures (docs/verification.md). The tolerance is the usual one: near the critical speed twice as much
    moves effects by half a percentage point, by chance, from ground to ground.
    """
    if softens:
        mesh = MeshSettings(growth=1.45, border=Border(elements=11))
    else:
        mesh = MeshSettings(size=0.25, growth=1.7, largest=2.0, border=Border(elements=10))
    return Settings(
        mesh=mesh,
        max_speed=max_speed,
        max_omega=max_omega,
        bands=WIDE_BANDS,
        panel_points=8,
        held_out=1,
    )
