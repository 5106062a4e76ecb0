"""Numerical settings of Step A: mesh, range, reduced basis, quadrature."""

from dataclasses import asdict, dataclass, replace
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
    A basis has ``least_solves`` solutions or more; with fewer, two good predictions may be chance.
    ``panel`` [rad/m] is the longest quadrature panel for k < 3 rad/m, fit for distances up to about
    12/(panel/2) m, ``panel_ratio`` its longest near k = 0, over k. The ground is a polynomial over
    pieces of ``piece_ratio`` ξ k. ``held_out`` points per band check the basis and change nothing.
    """

    mesh: MeshSettings = MeshSettings()
    max_omega: float = 160.0
    max_speed: float = 75.0
    bands: tuple[float, ...] = (0.01, 0.025, 0.06, 0.15, 0.4, 0.8, 1.5, 3.0, 5.0, 8.0, 12.0)
    tolerance: float = 1e-2
    max_solves: int = 60
    least_solves: int = 8
    panel: float = 0.045
    panel_points: int = 12
    panel_ratio: float = 0.2
    piece_ratio: float = 3.3
    held_out: int = 3

    def __post_init__(self) -> None:
        if list(self.bands) != sorted(set(self.bands)) or not self.bands or self.bands[0] <= 0.0:
            raise ValueError(f"wavenumber bands are {self.bands}; they must be positive and rising")
        for name in ("max_omega", "max_speed", "tolerance", "panel", "panel_ratio", "piece_ratio"):
            check_positive(name, getattr(self, name))
        if self.panel_points < 2 or self.max_solves < 3:
            raise ValueError(
                f"panel_points is {self.panel_points} and max_solves {self.max_solves}; "
                "at least 2 and 3 are needed"
            )
        if self.held_out < 1 or self.least_solves < 1:
            raise ValueError(
                f"held_out is {self.held_out} and least_solves {self.least_solves}; "
                "at least 1 is needed"
            )

    @property
    def description(self) -> dict[str, Any]:
        """All that a response depends on: everything but the points that check it.

        What only some settings have is named there alone, so that stored bases are found again.
        """
        found = asdict(self)
        del found["held_out"]
        for name in ("least_solves", "panel_ratio", "piece_ratio"):
            if found[name] == getattr(Settings, name):
                del found[name]
        return found

    @property
    def of_bases(self) -> "Settings":
        """The same with a fixed quadrature, on which the bases do not depend."""
        return replace(self, panel=1.0, panel_points=2, panel_ratio=0.2, piece_ratio=3.3)


def many_grounds_settings(max_speed: float, max_omega: float, softens: bool) -> Settings:
    """Settings for one ground of many, each of them alike and none looked at alone.

    Four wide bands of five solutions or more, eight points on panels and pieces more than twice as long
    as usual, and a mesh that grows faster away from the track, much faster on soil that does not soften.
    What that does to stresses, days and effects, ``studies/many_grounds.py`` measures
    (docs/verification.md).
    The tolerance is the usual one: near the critical speed twice as much moves effects by half a
    percentage point, by chance, from ground to ground.
    """
    if softens:
        mesh = MeshSettings(growth=1.45, border=Border(elements=11))
    else:
        mesh = MeshSettings(size=0.25, growth=1.7, largest=1.4, border=Border(elements=10))
    return Settings(
        mesh=mesh,
        max_speed=max_speed,
        max_omega=max_omega,
        bands=WIDE_BANDS,
        least_solves=5,
        panel_points=8,
        panel_ratio=0.5,
        piece_ratio=8.5,
        held_out=1,
    )
