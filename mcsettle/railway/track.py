"""The track and its ground as frozen descriptions, with the paper's tables as named instances.

Layers are listed from the sleeper downwards. A layer with a ``width`` belongs to the embankment
(ballast, sub-ballast); a layer without one reaches to infinity on both sides. The last ground layer
may be infinitely high (the half-space). Heights are metres, moduli pascals, densities kg/m³.

Two track models share one interface (``transfer.TrackResponse``): ``SectionTrack``, the 2.5D
finite-element cross-section of the case studies, and ``BeamTrack``, the closed-form beam on an
elastic layer of the paper's vehicle comparison.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np

from mcsettle.errors import check_positive

DAMPING_CONVENTIONS = ("damping_ratio", "loss_factor")


@dataclass(frozen=True)
class Material:
    """Linear isotropic material: Young's modulus [Pa], Poisson's ratio, density [kg/m³], damping.

    ``damping`` is the paper's hysteretic damping coefficient ξ; how it enters the complex modulus
    is the track's ``damping_convention``.
    """

    youngs_modulus: float
    poisson: float
    density: float
    damping: float

    def __post_init__(self) -> None:
        check_positive("Young's modulus", self.youngs_modulus, "Pa")
        check_positive("density", self.density, "kg/m³")
        if not -1.0 < self.poisson < 0.5:
            raise ValueError(f"Poisson's ratio is {self.poisson}; it must lie in (-1, 0.5)")
        if not 0.0 <= self.damping < 0.5:
            raise ValueError(f"damping is {self.damping}; it must lie in [0, 0.5)")

    @property
    def shear_modulus(self) -> float:
        """Shear modulus G = E / 2(1 + ν) [Pa]."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poisson))

    @property
    def shear_wave_speed(self) -> float:
        """Speed of shear waves √(G/ρ) [m/s]."""
        return math.sqrt(self.shear_modulus / self.density)

    @property
    def pressure_wave_speed(self) -> float:
        """Speed of pressure waves √((λ + 2μ)/ρ) [m/s]."""
        nu = self.poisson
        return self.shear_wave_speed * math.sqrt((2.0 - 2.0 * nu) / (1.0 - 2.0 * nu))


@dataclass(frozen=True)
class BallastLaw:
    """Ballast settlement, Eq. (1): ε = coefficient σ_d² (1 + log_slope log10 N), σ_d in MPa."""

    coefficient: float = 0.375
    log_slope: float = 0.4

    def __post_init__(self) -> None:
        check_positive("ballast law coefficient", self.coefficient, "1/MPa²")
        check_positive("ballast law log_slope", self.log_slope, "-")

    @property
    def exponent(self) -> float:
        """Exponent of the deviatoric stress."""
        return 2.0


@dataclass(frozen=True)
class PowerLaw:
    """Li–Selig settlement, Eq. (2): ε[%] = a (σ_d/strength)^m N^b; strength in Pa."""

    a: float
    b: float
    m: float
    strength: float

    def __post_init__(self) -> None:
        check_positive("settlement parameter a", self.a, "%")
        if not 0.0 < self.b < 1.0:
            raise ValueError(f"settlement parameter b is {self.b}; it must lie in (0, 1)")
        check_positive("settlement parameter m", self.m, "-")
        check_positive("compressive strength", self.strength, "Pa")

    @property
    def exponent(self) -> float:
        """Exponent of the deviatoric stress."""
        return self.m


Law = BallastLaw | PowerLaw


@dataclass(frozen=True)
class Layer:
    """One layer: height [m] (``inf`` for a half-space), full width [m] (None: unbounded), law, K0."""

    name: str
    height: float
    material: Material
    law: Law | None = None
    width: float | None = None
    k0: float = 0.5

    def __post_init__(self) -> None:
        if self.width is not None or self.height != math.inf:
            check_positive(f"height of layer '{self.name}'", self.height, "m")
        if self.width is not None:
            check_positive(f"width of layer '{self.name}'", self.width, "m")
        if not 0.0 < self.k0 <= 3.0:
            raise ValueError(f"K0 of layer '{self.name}' is {self.k0}; it must lie in (0, 3]")


@dataclass(frozen=True)
class Rail:
    """One rail (UIC 60 by default): an Euler–Bernoulli beam at y = ±offset [m]. Appendix B."""

    youngs_modulus: float = 2.11e11
    second_moment: float = 3.038e-5
    area: float = 7.677e-3
    density: float = 7850.0
    damping: float = 0.01
    offset: float = 0.75
    foot_width: float = 0.15

    def __post_init__(self) -> None:
        check_positive("rail Young's modulus", self.youngs_modulus, "Pa")
        check_positive("rail second moment of area", self.second_moment, "m⁴")
        check_positive("rail area", self.area, "m²")
        check_positive("rail density", self.density, "kg/m³")
        check_positive("rail foot width", self.foot_width, "m")
        check_positive("rail offset", self.offset, "m")

    @property
    def bending_stiffness(self) -> float:
        """E I of one rail [N·m²]."""
        return self.youngs_modulus * self.second_moment

    @property
    def mass_per_length(self) -> float:
        """ρ A of one rail [kg/m]."""
        return self.density * self.area


@dataclass(frozen=True)
class RailPad:
    """Continuous pad under one rail: stiffness [N/m²] and viscous damping [N·s/m²]. Appendix B."""

    stiffness: float = 255e6
    damping: float = 22.5e3

    def __post_init__(self) -> None:
        check_positive("rail pad stiffness", self.stiffness, "N/m²")
        if not 0.0 <= self.damping < math.inf:
            raise ValueError(f"rail pad damping is {self.damping}; it must be 0 or more N·s/m²")


@dataclass(frozen=True)
class Sleeper:
    """Sleepers (G44 by default), smeared along the track as an orthotropic layer.

    ``length`` across the track, ``height``, ``width`` along the track and ``spacing`` [m]. The
    smeared layer has almost no stiffness along x; its other moduli and its density are those of
    ``material`` times width/spacing.
    """

    length: float = 2.5
    height: float = 0.2
    width: float = 0.285
    spacing: float = 0.65
    material: Material = Material(3e10, 0.15, 2500.0, 0.01)

    def __post_init__(self) -> None:
        for name in ("length", "height", "width", "spacing"):
            check_positive(f"sleeper {name}", getattr(self, name), "m")
        if self.width > self.spacing:
            raise ValueError(f"sleeper width {self.width} m exceeds their spacing {self.spacing} m")

    @property
    def fill(self) -> float:
        """Share of the track length occupied by sleepers, width/spacing."""
        return self.width / self.spacing


@dataclass(frozen=True)
class SectionTrack:
    """Ballasted track on layered ground, solved as a 2.5D FEM-PML cross-section (Step A)."""

    layers: tuple[Layer, ...]
    rail: Rail = Rail()
    pad: RailPad = RailPad()
    sleeper: Sleeper = Sleeper()
    damping_convention: str = "damping_ratio"

    def __post_init__(self) -> None:
        _check_layers(self.layers)
        if not math.isinf(self.layers[-1].height):
            raise ValueError("the lowest layer of a section track must be a half-space")
        if self.damping_convention not in DAMPING_CONVENTIONS:
            raise ValueError(
                f"damping_convention is '{self.damping_convention}'; "
                f"choose one of {', '.join(DAMPING_CONVENTIONS)}"
            )
        widths = [self.sleeper.length] + [w.width for w in self.layers if w.width is not None]
        if any(lower < upper for upper, lower in pairwise(widths)):
            raise ValueError(f"each layer must be at least as wide as the one above: {widths} m")

    def __str__(self) -> str:
        return "section track\n" + layer_lines(self.layers)

    @property
    def embankment(self) -> tuple[Layer, ...]:
        """Layers of finite width, from the sleeper down."""
        return tuple(layer for layer in self.layers if layer.width is not None)

    @property
    def ground(self) -> tuple[Layer, ...]:
        """Layers that reach to infinity, from the subgrade surface down."""
        return tuple(layer for layer in self.layers if layer.width is None)


@dataclass(frozen=True)
class BeamTrack:
    """Euler–Bernoulli rails on a continuous elastic layer: the paper's simplified track.

    ``support_stiffness`` [N/m²] is per rail. Stresses: the support reaction spread over the sleeper
    length on a homogeneous elastic half-space of Poisson's ratio ``poisson``; ``layers`` provide
    only the settlement laws, the unit weights and K0 over depth below the sleeper.
    """

    layers: tuple[Layer, ...]
    rail: Rail = Rail(2.1e11, 30.55e-6, 0.00763, 7850.0, 0.0)
    support_stiffness: float = 100e6
    support_damping: float = 0.0
    sleeper_length: float = 2.5
    poisson: float = 0.3

    def __str__(self) -> str:
        return "beam track\n" + layer_lines(self.layers)

    def __post_init__(self) -> None:
        _check_layers(self.layers)
        check_positive("support stiffness", self.support_stiffness, "N/m²")
        check_positive("sleeper length", self.sleeper_length, "m")
        if not 0.0 <= self.support_damping < 1.0:
            raise ValueError(
                f"support damping (loss factor) is {self.support_damping}; it must lie in [0, 1)"
            )
        if not 0.0 <= self.poisson < 0.5:
            raise ValueError(f"Poisson's ratio is {self.poisson}; it must lie in [0, 0.5)")


def layer_lines(layers: tuple[Layer, ...]) -> str:
    """Layers as text, one per line: name, height, modulus, law."""
    return "\n".join(
        f"{layer.name:<18} {layer.height:>6.2f} m  E {layer.material.youngs_modulus / 1e6:>6.0f} MPa"
        f"  {'does not settle' if layer.law is None else layer.law}"
        for layer in layers
    )


Track = SectionTrack | BeamTrack
OfTrack = TypeVar("OfTrack", bound=SectionTrack | BeamTrack)


def without_laws(track: OfTrack) -> OfTrack:
    """``track`` without its settlement laws: they belong to Step B, and Step A is the same without."""
    return replace(track, layers=tuple(replace(layer, law=None) for layer in track.layers))


def depth_below_subgrade(layers: tuple[Layer, ...]) -> float:
    """Height [m] of the embankment above the subgrade surface z = 0 (sleeper base level)."""
    return sum(layer.height for layer in layers if layer.width is not None)


def _check_layers(layers: tuple[Layer, ...]) -> None:
    if not layers:
        raise ValueError("a track needs at least one layer")
    names = [layer.name for layer in layers]
    if len(set(names)) != len(names):
        raise ValueError(f"layer names must differ, received {names}")
    seen_ground = False
    for index, layer in enumerate(layers):
        if layer.width is not None and seen_ground:
            raise ValueError(f"embankment layer '{layer.name}' lies below a ground layer")
        seen_ground = seen_ground or layer.width is None
        if math.isinf(layer.height) and index != len(layers) - 1:
            raise ValueError(f"only the lowest layer may be a half-space, not '{layer.name}'")


# Table 2 of the paper (case studies). Unlike in the validation case there is no thin upper soil layer:
# the lean clay is one half-space.
BALLAST = Layer("ballast", 0.3, Material(180e6, 0.27, 1650.0, 0.06), BallastLaw(), 2.8)
SUB_BALLAST = Layer(
    "sub_ballast", 0.5, Material(180e6, 0.30, 2300.0, 0.05), PowerLaw(0.52, 0.15, 1.49, 350e3), 3.5
)
LEAN_CLAY = Layer(
    "subgrade", math.inf, Material(70e6, 0.35, 1900.0, 0.03), PowerLaw(1.10, 0.16, 2.0, 250e3)
)
CASE_STUDY_TRACK = SectionTrack((BALLAST, SUB_BALLAST, LEAN_CLAY))
TOY_TRACK = BeamTrack((BALLAST, SUB_BALLAST, LEAN_CLAY))

# Appendix B (validation case). The sub-ballast settlement law is not given there: Table 2's.
VALIDATION_TRACK = SectionTrack(
    (
        Layer("ballast", 0.3, Material(180e6, 0.27, 1600.0, 0.061), BallastLaw(), 2.8),
        Layer("sub_ballast", 0.5, Material(212e6, 0.30, 1913.0, 0.054), SUB_BALLAST.law, 3.5),
        Layer(
            "subgrade_1", 0.5, Material(30e6, 0.30, 2000.0, 0.03), PowerLaw(0.64, 0.10, 1.70, 100e3)
        ),
        Layer(
            "subgrade_2",
            math.inf,
            Material(80e6, 0.30, 2000.0, 0.03),
            PowerLaw(0.64, 0.10, 1.70, 220e3),
        ),
    )
)
TRACKS: dict[str, Track] = {
    "case_study": CASE_STUDY_TRACK,
    "validation": VALIDATION_TRACK,
    "beam": TOY_TRACK,
}


def rayleigh_speed(material: Material) -> float:
    """Speed of the Rayleigh wave of a half-space of ``material`` [m/s], from its secular equation.

    With x = (c_R/c_S)² and r = (c_S/c_P)²: x³ - 8x² + (24 - 16 r) x - 16 (1 - r) = 0.

    >>> round(rayleigh_speed(Material(2.5e8, 0.25, 1000.0, 0.0)) / (1e5 / 1e3) ** 0.5 / 31.6228, 4)
    0.9194
    """
    ratio = (material.shear_wave_speed / material.pressure_wave_speed) ** 2
    roots = np.roots([1.0, -8.0, 24.0 - 16.0 * ratio, -16.0 * (1.0 - ratio)])
    real = roots[np.abs(roots.imag) < 1e-9].real
    x = real[(real > 0.0) & (real < 1.0)].min()
    return float(material.shear_wave_speed * np.sqrt(x))
