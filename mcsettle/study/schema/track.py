"""``[track]`` and its tables: rail, pad, sleepers, layers, ground, softening."""

from typing import Annotated, Literal

from pydantic import Field

from mcsettle.railway.modulus_curves import Kind
from mcsettle.study.schema.base import Fraction, Name, Positive, Share, Soil, Table
from mcsettle.study.schema.quantities import (
    Area,
    Density,
    LineDamping,
    LineStiffness,
    Metres,
    Millimetres,
    Pascals,
    SecondMoment,
    SpringStiffness,
    in_plain,
    quantity,
)

LoadPerRail = Literal["half", "whole"]


class LayerTable(Table):
    """``[track.layers.<name>]``: what replaces the preset's values in one layer."""

    height_m: Annotated[Metres, Field(le=1000)] | None = None
    width_m: Annotated[Metres, Field(le=1000)] | None = None
    youngs_modulus_pa: Pascals | None = None
    poisson: Annotated[float, Field(gt=-1, lt=0.5)] | None = None
    density_kg_per_m3: Density | None = None
    damping: Fraction | None = None
    k0: Annotated[float, Field(gt=0, le=3)] | None = None
    ballast_coefficient_per_mpa2: Annotated[Positive, in_plain("1/MPa2")] | None = None
    ballast_log_slope: Positive | None = None
    settlement_a: Positive | None = None
    settlement_b: Annotated[float, Field(gt=0, lt=1)] | None = None
    settlement_m: Positive | None = None
    strength_pa: Pascals | None = None
    curve: Kind | None = None
    plasticity_index: Annotated[float, Field(ge=0, le=200)] | None = None
    ocr: Annotated[float, Field(ge=1, le=1000)] | None = None
    uniformity_coefficient: Annotated[float, Field(ge=1, le=1000)] | None = None
    d50_mm: Millimetres | None = None


class SofteningTable(Table):
    """``[track.softening]``: how strains soften the layers (soil = "equivalent_linear")."""

    strain_factor: Annotated[float, Field(gt=0, le=2)] = 0.65
    octahedral: Literal["third", "engineering"] = "third"
    tolerance: Annotated[float, Field(gt=0, lt=1)] = 0.03
    max_iterations: Annotated[int, Field(ge=1, le=1000)] = 10
    keep_last: bool = False


class RailTable(Table):
    """``[track.rail]``: one rail."""

    youngs_modulus_pa: Pascals | None = None
    second_moment_m4: SecondMoment | None = None
    area_m2: Area | None = None
    density_kg_per_m3: Density | None = None
    damping: Fraction | None = None
    offset_m: Metres | None = None


class PadTable(Table):
    """``[track.pad]``: the continuous pad under one rail (section model)."""

    stiffness_n_per_m2: LineStiffness | None = None
    damping_ns_per_m2: LineDamping | None = None


class SleeperTable(Table):
    """``[track.sleeper]``: the sleepers, smeared along the track (section model)."""

    length_m: Metres | None = None
    height_m: Metres | None = None
    width_m: Metres | None = None
    spacing_m: Metres | None = None
    youngs_modulus_pa: Pascals | None = None
    density_kg_per_m3: Density | None = None


class SupportTable(Table):
    """``[track.support]``: the elastic layer under one rail (beam model)."""

    stiffness_n_per_m2: LineStiffness | None = None
    loss_factor: Annotated[float, Field(ge=0, lt=1)] | None = None
    sleeper_length_m: Metres | None = None
    poisson: Annotated[float, Field(ge=0, lt=0.5)] | None = None


class GroundTable(LayerTable):
    """``[[track.ground]]``: one ground layer in full, from the subgrade surface down."""

    name: Name


class UnderSleeperPadTable(Table):
    """``[track.under_sleeper_pad]``: an elastic pad below every sleeper (section model)."""

    bedding_modulus_n_per_m3: Annotated[float, quantity("N/m^3"), Field(gt=0)]
    thickness_m: Annotated[Metres, Field(le=0.1)] = 0.01
    damping: Fraction = 0.05
    density_kg_per_m3: Density = 1000.0


class TrackTable(Table):
    """``[track]``: a named track of the paper and what differs from it.

    ``hertz_stiffness_n_per_m`` is of the contact of one wheelset: two rails. ``rail_bending_share``
    (default 0) and ``load_per_rail`` (default "half"): how much of the rail's bending counts, and how
    much of a wheelset's load presses on each rail.
    """

    library: Name | None = None
    model: Literal["section", "beam"] = "section"
    preset: Literal["case_study", "validation", "beam"] | None = None
    soil: Soil = "linear"
    damping_convention: Literal["damping_ratio", "loss_factor"] = "damping_ratio"
    allow_supercritical: bool = False
    hertz_stiffness_n_per_m: SpringStiffness = 2.72e9
    rail_bending_share: Share | None = None
    load_per_rail: LoadPerRail | None = None
    rail: RailTable = RailTable()
    pad: PadTable = PadTable()
    sleeper: SleeperTable = SleeperTable()
    support: SupportTable = SupportTable()
    under_sleeper_pad: UnderSleeperPadTable | None = None
    softening: SofteningTable | None = None
    layers: dict[Name, LayerTable] = Field(default={})
    ground: Annotated[tuple[GroundTable, ...], Field(max_length=60)] = ()

    @property
    def preset_name(self) -> str:
        """The named track this one starts from."""
        return self.preset or ("beam" if self.model == "beam" else "case_study")
