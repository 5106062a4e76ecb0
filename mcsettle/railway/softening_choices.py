"""Choices of equivalent-linear soil: how strains are measured, which curve each layer follows."""

from dataclasses import dataclass

from mcsettle.railway.modulus_curves import Curve
from mcsettle.railway.track import SectionTrack
from mcsettle.railway.traffic import Train

OCTAHEDRAL = {"third": 1.0 / 3.0, "engineering": 2.0 / 3.0}
EMBANKMENT_CURVE = Curve("ishibashi_zhang", plasticity_index=0.0)
GROUND_CURVE = Curve("ishibashi_zhang", plasticity_index=15.0)  # lean clay


@dataclass(frozen=True)
class SofteningSettings:
    """Choices of the equivalent-linear iteration.

    The effective strain is ``strain_factor`` times the largest octahedral shear strain of a train
    passage, ``octahedral`` "third" or "engineering" (2/3: twice as large). The iteration ends when
    no modulus changes by more than the share ``tolerance``; without that after ``max_iterations`` it
    is an error, or with ``keep_last`` the last iterate and a warning. ``curves`` names layers that do
    not follow the default (Ishibashi–Zhang, PI 0 in the embankment and 15 in the ground).
    """

    strain_factor: float = 0.65
    octahedral: str = "third"
    tolerance: float = 0.03
    max_iterations: int = 10
    keep_last: bool = False
    curves: tuple[tuple[str, Curve], ...] = ()

    def __post_init__(self) -> None:
        if not 0.0 < self.strain_factor <= 2.0:
            raise ValueError(f"strain_factor is {self.strain_factor}; it must lie in (0, 2]")
        if self.octahedral not in OCTAHEDRAL:
            raise ValueError(
                f"octahedral is '{self.octahedral}'; choose one of {', '.join(OCTAHEDRAL)}"
            )
        if not 0.0 < self.tolerance < 1.0:
            raise ValueError(f"tolerance is {self.tolerance}; it must lie in (0, 1)")
        if self.max_iterations < 1:
            raise ValueError(f"max_iterations is {self.max_iterations}; at least 1 is needed")

    def layer_curves(self, track: SectionTrack) -> tuple[Curve, ...]:
        """The curve of every layer of a track, from the sleeper down.

        Raises
        ------
        ValueError
            If ``curves`` names a layer that the track does not have.
        """
        named = dict(self.curves)
        names = [layer.name for layer in track.layers]
        unknown = sorted(set(named) - set(names))
        if unknown:
            raise ValueError(f"no layer '{unknown[0]}' in this track; choose one of {names}")
        return tuple(
            named.get(layer.name, GROUND_CURVE if layer.width is None else EMBANKMENT_CURVE)
            for layer in track.layers
        )


@dataclass(frozen=True)
class Softened:
    """What softens a ground: one train at one speed [m/s], by these choices.

    In mixed traffic every service has a ground of its own: moduli are those of its own passage.
    """

    train: Train
    speed: float
    settings: SofteningSettings
