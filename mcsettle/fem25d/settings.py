"""Numerical settings of Step A: mesh, range, reduced basis, quadrature.

Depends on: section.
"""

from dataclasses import dataclass

from mcsettle.fem25d.section import MeshSettings


@dataclass(frozen=True)
class Settings:
    """All numerical choices behind a section response.

    The response is available for speeds up to ``max_speed`` [m/s] and driving frequencies up to
    ``max_omega`` [rad/s]: the basis is trained on ω ≤ max_omega + k max_speed for k up to the last
    of ``bands`` [rad/m]. ``tolerance`` ends the growth of a basis: error at its worst points, and the
    largest change of an output by the last growth; the error elsewhere is mostly below a tenth of it.
    ``panel`` [rad/m] is the longest quadrature panel for k < 3 rad/m, fit for distances up to about
    12/(panel/2) m.
    """

    mesh: MeshSettings = MeshSettings()
    max_omega: float = 160.0
    max_speed: float = 75.0
    bands: tuple[float, ...] = (0.01, 0.025, 0.06, 0.15, 0.4, 0.8, 1.5, 3.0, 5.0, 8.0, 12.0)
    tolerance: float = 1e-2
    max_solves: int = 60
    panel: float = 0.045
    panel_points: int = 12

    def __post_init__(self) -> None:
        if list(self.bands) != sorted(set(self.bands)) or not self.bands or self.bands[0] <= 0.0:
            raise ValueError(f"wavenumber bands are {self.bands}; they must be positive and rising")
        for name in ("max_omega", "max_speed", "tolerance", "panel"):
            value = getattr(self, name)
            if not 0.0 < value < float("inf"):
                raise ValueError(f"{name} is {value}; it must be positive and finite")
        if self.panel_points < 2 or self.max_solves < 3:
            raise ValueError(
                f"panel_points is {self.panel_points} and max_solves {self.max_solves}; "
                "at least 2 and 3 are needed"
            )
