"""The tables of a study file: keys, units, defaults and the limits of single values.

One frozen model a table. What a table means for the model (presets filled in, objects built) is
``study_build``; what several tables must satisfy together is ``study_checks``.
"""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from mcsettle.railway.modulus_curves import Kind
from mcsettle.study import quantities as u
from mcsettle.units import DAYS_PER_YEAR, MM

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.\-]*$", max_length=40)]
Text = Annotated[str, Field(max_length=2000)]
FileName = Annotated[str, Field(min_length=1, max_length=500)]
Column = Annotated[str, Field(min_length=1, max_length=100)]
Fraction = Annotated[float, Field(ge=0, lt=0.5)]
Positive = Annotated[float, Field(gt=0)]
Cycles = Annotated[float, Field(ge=1, le=1e12)]
StressKind = Literal["traffic", "total"]
Spectrum = Literal["fra", "fra_one_corner", "german_low", "german_high"]
Soil = Literal["linear", "equivalent_linear"]
Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")]
CycleCount = Literal["shared", "per_vehicle"]
METRICS = Literal[
    "tamping_interval_days",
    "reduction_percent",
    "elasticity",
    "marginal_cost",
    "sd_growth_1y_mm",
    "mgt_increase_percent",
    "quasi_static_stress_increase_percent",
    "dynamic_stress_increase_percent",
]


class Table(BaseModel):
    """A table of the study file: unknown keys are refused, values never change after reading."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class LayerTable(Table):
    """``[track.layers.<name>]``: what replaces the preset's values in one layer."""

    height_m: u.Metres | None = None
    width_m: u.Metres | None = None
    youngs_modulus_pa: u.Pascals | None = None
    poisson: Annotated[float, Field(gt=-1, lt=0.5)] | None = None
    density_kg_per_m3: u.Density | None = None
    damping: Fraction | None = None
    k0: Annotated[float, Field(gt=0, le=3)] | None = None
    ballast_coefficient_per_mpa2: Positive | None = None
    ballast_log_slope: Positive | None = None
    settlement_a: Positive | None = None
    settlement_b: Annotated[float, Field(gt=0, lt=1)] | None = None
    settlement_m: Positive | None = None
    strength_pa: u.Pascals | None = None
    curve: Kind | None = None
    plasticity_index: Annotated[float, Field(ge=0, le=200)] | None = None
    ocr: Annotated[float, Field(ge=1, le=1000)] | None = None
    uniformity_coefficient: Annotated[float, Field(ge=1, le=1000)] | None = None
    d50_mm: u.Millimetres | None = None


class SofteningTable(Table):
    """``[track.softening]``: how strains soften the layers (soil = "equivalent_linear")."""

    strain_factor: Annotated[float, Field(gt=0, le=2)] = 0.65
    octahedral: Literal["third", "engineering"] = "third"
    tolerance: Annotated[float, Field(gt=0, lt=1)] = 0.03
    max_iterations: Annotated[int, Field(ge=1, le=1000)] = 10
    keep_last: bool = False


class RailTable(Table):
    """``[track.rail]``: one rail."""

    youngs_modulus_pa: u.Pascals | None = None
    second_moment_m4: u.SecondMoment | None = None
    area_m2: u.Area | None = None
    density_kg_per_m3: u.Density | None = None
    damping: Fraction | None = None
    offset_m: u.Metres | None = None


class PadTable(Table):
    """``[track.pad]``: the continuous pad under one rail (section model)."""

    stiffness_n_per_m2: u.LineStiffness | None = None
    damping_ns_per_m2: u.LineDamping | None = None


class SleeperTable(Table):
    """``[track.sleeper]``: the sleepers, smeared along the track (section model)."""

    length_m: u.Metres | None = None
    height_m: u.Metres | None = None
    width_m: u.Metres | None = None
    spacing_m: u.Metres | None = None
    youngs_modulus_pa: u.Pascals | None = None
    density_kg_per_m3: u.Density | None = None


class SupportTable(Table):
    """``[track.support]``: the elastic layer under one rail (beam model)."""

    stiffness_n_per_m2: u.LineStiffness | None = None
    loss_factor: Annotated[float, Field(ge=0, lt=1)] | None = None
    sleeper_length_m: u.Metres | None = None
    poisson: Annotated[float, Field(ge=0, lt=0.5)] | None = None


class GroundTable(LayerTable):
    """``[[track.ground]]``: one ground layer in full, from the subgrade surface down."""

    name: Name


class SoilTable(Table):
    """``[grounds.materials.<code>]``: a soil of a list of grounds; ``no_law`` says why it has none."""

    youngs_modulus_pa: u.Pascals
    poisson: Annotated[float, Field(gt=-1, lt=0.5)]
    density_kg_per_m3: u.Density
    damping: Fraction
    k0: Annotated[float, Field(gt=0, le=3)] = 0.5
    settlement_a: Positive | None = None
    settlement_b: Annotated[float, Field(gt=0, lt=1)] | None = None
    settlement_m: Positive | None = None
    strength_pa: u.Pascals | None = None
    no_law: Text = ""
    source: Text = ""


class GroundsTable(Table):
    """``[grounds]``: many possible layered grounds with probabilities, each a parameter set."""

    layers: FileName
    weights: FileName
    separator: Literal["comma", "semicolon", "tab"] = "semicolon"
    ground_column: Column = "soilprofile_id"
    top_column: Column = "top_level"
    material_column: Column = "soil_name"
    segment_column: Column = "segment_id"
    probability_column: Column = "probability"
    leave_out: Annotated[tuple[Column, ...], Field(max_length=100)] = ()
    fine_m: Annotated[u.Metres, Field(ge=0.1, le=5)] = 0.5
    fine_depth_m: Annotated[u.Metres, Field(ge=0.1, le=50)] = 6.0
    coarse_m: Annotated[u.Metres, Field(ge=0.1, le=10)] = 1.0
    depth_m: Annotated[u.Metres, Field(ge=0.5, le=100)] = 10.0
    materials: Annotated[dict[Column, SoilTable], Field(min_length=1, max_length=1000)]
    sha256: Annotated[tuple[str, ...], Field(max_length=2)] | None = None


class UnderSleeperPadTable(Table):
    """``[track.under_sleeper_pad]``: an elastic pad below every sleeper (section model)."""

    bedding_modulus_n_per_m3: Annotated[float, u.quantity("N/m^3"), Field(gt=0)]
    thickness_m: Annotated[u.Metres, Field(le=0.1)] = 0.01
    damping: Fraction = 0.05
    density_kg_per_m3: u.Density = 1000.0


class TrackTable(Table):
    """``[track]``: a named track of the paper and what differs from it.

    ``hertz_stiffness_n_per_m`` is of the contact of one wheelset: two rails.
    """

    library: Name | None = None
    model: Literal["section", "beam"] = "section"
    preset: Literal["case_study", "validation", "beam"] | None = None
    soil: Soil = "linear"
    damping_convention: Literal["damping_ratio", "loss_factor"] = "damping_ratio"
    allow_supercritical: bool = False
    hertz_stiffness_n_per_m: u.SpringStiffness = 2.72e9
    rail: RailTable = RailTable()
    pad: PadTable = PadTable()
    sleeper: SleeperTable = SleeperTable()
    support: SupportTable = SupportTable()
    under_sleeper_pad: UnderSleeperPadTable | None = None
    softening: SofteningTable | None = None
    layers: dict[Name, LayerTable] = {}
    ground: Annotated[tuple[GroundTable, ...], Field(max_length=60)] = ()

    @property
    def preset_name(self) -> str:
        """The named track this one starts from."""
        return self.preset or ("beam" if self.model == "beam" else "case_study")


class RecordTable(Table):
    """``[profile.record]``: how the measured record is written, and what is taken of it."""

    chainage_column: Column = "chainage_m"
    level_column: Column = "level_mm"
    run_column: Column | None = None
    chainage_unit: Literal["m", "km", "ft", "yd", "mi"] | None = None
    level_unit: Literal["mm", "m", "cm", "in"] | None = None
    positive: Literal["down", "up"] = "down"
    separator: Literal["comma", "semicolon", "tab", "space"] = "comma"
    decimal: Literal[".", ","] = "."
    skip_rows: Annotated[int, Field(ge=0, le=10_000)] = 0
    run: Column | None = None
    repair: Annotated[
        tuple[Literal["missing", "unordered", "repeated", "gaps", "spikes"], ...],
        Field(max_length=5),
    ] = ()
    longest_gap_m: Annotated[u.Metres, Field(le=100)] = 5.0
    filter: Literal["ideal", "butterworth", "en13848_d1"] = "ideal"
    filter_order: Annotated[int, Field(ge=1, le=12)] = 4
    ensemble: Literal["section", "phases", "sections"] = "section"
    section: Annotated[int, Field(ge=1, le=1_000_000)] = 1
    noise_mm: Annotated[u.Millimetres, Field(le=10)] | None = None
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")] | None = None


class ProfileTable(Table):
    """``[profile]``: the track irregularity before traffic, random or measured."""

    file: FileName | None = None
    record: RecordTable | None = None
    spectrum: Spectrum = "fra"
    fra_class: Annotated[int, Field(ge=1, le=6)] = 6
    sd_mm: Annotated[u.Millimetres, Field(le=50)] | None = None
    window_m: Annotated[u.Metres, Field(ge=70, le=2000)] = 200.0
    shortest_m: Annotated[u.Metres, Field(ge=1)] = 3.0
    longest_m: Annotated[u.Metres, Field(le=200)] = 35.0

    @property
    def sd(self) -> float | None:
        """Standard deviation every realisation is scaled to [m]; None: left as drawn."""
        return None if self.sd_mm is None else self.sd_mm * MM


class SettlementTable(Table):
    """``[settlement]``: how stress and load cycles become settlement (Step B).

    ``factor_digest`` says which transfer functions the factor was found for; it changes nothing.
    """

    stress: StressKind = "traffic"
    cycles: CycleCount = "shared"
    ballast_cycles_before: Cycles = 100_000.0
    subgrade_cycles_before: Cycles = 100_000.0
    cycles_per_passage: Annotated[float, Field(gt=0, le=1e6)] = 1.0
    settlement_factor: Annotated[float, Field(gt=0, le=1e6)] = 1.0
    integration_depth_m: Annotated[u.Metres, Field(le=100)] = 5.5
    factor_digest: Digest | None = None


class LimitTable(Table):
    """``[limit]``: when the track is tamped, and how long a realisation is followed."""

    sd_limit_mm: Annotated[u.Millimetres, Field(le=100)]
    horizon_years: Annotated[u.Years, Field(le=1000)] = 50.0

    @property
    def sd_limit(self) -> float:
        """Intervention threshold on the standard deviation [m]."""
        return self.sd_limit_mm * MM

    @property
    def horizon_days(self) -> float:
        """Days after which a realisation is censored."""
        return self.horizon_years * DAYS_PER_YEAR


class RunTable(Table):
    """``[run]``: how many realisations, of how many draws of the inputs, and how they advance."""

    realisations: Annotated[int, Field(ge=1, le=10_000_000)] = 200
    parameter_sets: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    stepping: Literal["cycle_jump", "every_axle", "every_train"] = "cycle_jump"
    right_hand_side: Literal["spectral", "pointwise"] = "spectral"
    precision: Literal["f64", "f32"] = "f64"
    history_days: Annotated[tuple[u.Days, ...], Field(max_length=1000)] = (
        0.0, 30.0, 91.0, 182.0, 365.0, 730.0, 1095.0, 1825.0, 3650.0,
    )  # fmt: skip


class EconomicsTable(Table):
    """``[economics]``: what is compared with what, and at which cost (Eqs 4–9)."""

    effect: Literal["speed", "tonnage"]
    baseline: Name
    tamping_cost_gbp_per_track_km: Positive = 5625.0
    discount_rate: Annotated[float, Field(gt=0, lt=1)] = 0.035
    base_speed_kmh: u.Speed | None = None
    trains_thousand_per_year: Positive | None = None
    mgt_per_day: Positive | None = None
    price_base_year: Annotated[int, Field(ge=1900, le=2200)] | None = None


class MaintenanceTable(Table):
    """``[maintenance]``: what a tamping leaves, again and again, to renewal."""

    recovery: Literal["perfect", "linear"]
    intercept_mm: Annotated[float, u.quantity("mm"), Field(ge=0, le=50)] | None = None
    slope: Annotated[float, Field(ge=0, lt=1)] | None = None
    scatter_mm: Annotated[float, u.quantity("mm"), Field(ge=0, le=10)] = 0.0
    floor_mm: Annotated[u.Millimetres, Field(le=50)] = 0.1
    shape: Literal["scaled", "initial", "redrawn"] = "scaled"
    damage_per_tamping: Annotated[float, Field(ge=0, le=10)] = 0.0
    ballast_cycles_after: Cycles | None = None
    ground_renewed: bool = False
    cycles: Annotated[int, Field(ge=1, le=200)] = 20
    renewal_years: Annotated[u.Years, Field(le=200)] | None = None


class CarTable(Table):
    """What describes a car; keys left out follow the vehicle that is named."""

    model: Literal["complete", "bogies", "wheelsets"] | None = None
    car_length_m: u.Metres | None = None
    bogie_spacing_m: u.Metres | None = None
    axle_spacing_m: u.Metres | None = None
    axle_load_t: u.Tonnes | None = None
    body_mass_kg: u.Mass | None = None
    body_inertia_kg_m2: u.Inertia | None = None
    bogie_mass_kg: u.Mass | None = None
    bogie_inertia_kg_m2: u.Inertia | None = None
    wheelset_mass_kg: u.Mass | None = None
    primary_stiffness_n_per_m: u.SpringStiffness | None = None
    primary_damping_ns_per_m: u.DashpotDamping | None = None
    secondary_stiffness_n_per_m: u.SpringStiffness | None = None
    secondary_damping_ns_per_m: u.DashpotDamping | None = None


class VehicleTable(CarTable):
    """``[vehicles.<name>]``: a vehicle of your own, like another one or in full."""

    like: Name | None = None
    source: Text = ""


class ConsistTable(CarTable):
    """One entry of a consist: cars in a row; ``axle_loads_t`` from the leading wheelset back."""

    vehicle: Name
    count: Annotated[int, Field(ge=1, le=200)] = 1
    axle_loads_t: Annotated[tuple[u.Tonnes, ...], Field(min_length=4, max_length=4)] | None = None


class TrainTable(CarTable):
    """``[trains.<name>]``: cars all alike (vehicle, cars), a consist, or a shipped train by name."""

    library: Name | None = None
    vehicle: Name | None = None
    cars: Annotated[int, Field(ge=1, le=200)] | None = None
    consist: Annotated[tuple[ConsistTable, ...], Field(min_length=1, max_length=200)] | None = None


class ServiceTable(Table):
    """One entry of a timetable: a train, its speed, and how often it runs in a row each day."""

    train: Name
    speed_kmh: u.Speed
    per_day: Annotated[int, Field(ge=1, le=10_000)]


class ScenarioTable(Table):
    """``[[scenarios]]``: one timetable; tonnages replace the sums over its trains (economics)."""

    name: Name
    title: Text = ""
    timetable: Annotated[tuple[ServiceTable, ...], Field(min_length=1, max_length=100)]
    mgt_per_day: Positive | None = None
    mgt_per_year: Positive | None = None


class VariantTable(Table):
    """``[[variants]]``: another reading of the same study; keys left out follow the study's own."""

    name: Name
    title: Text = ""
    soil: Soil | None = None
    damping_convention: Literal["damping_ratio", "loss_factor"] | None = None
    spectrum: Spectrum | None = None
    fra_class: Annotated[int, Field(ge=1, le=6)] | None = None
    stress: StressKind | None = None
    cycles: CycleCount | None = None
    ballast_cycles_before: Cycles | None = None
    subgrade_cycles_before: Cycles | None = None
    cycles_per_passage: Annotated[float, Field(gt=0, le=1e6)] | None = None
    settlement_factor: Annotated[float, Field(gt=0, le=1e6)] | None = None
    integration_depth_m: Annotated[u.Metres, Field(le=100)] | None = None
    factor_digest: Digest | None = None
    layers: dict[Name, LayerTable] = {}


class ReferenceTable(Table):
    """``[[reference]]``: a published value to print beside the study's own.

    ``note`` says why the two differ.
    """

    metric: METRICS
    scenario: Name
    value: float
    unit: Text
    source: Text
    note: Text = ""


class CalibrationTable(Table):
    """``[calibration]``: where a settlement factor came from; it changes nothing.

    ``study`` names the study it was found with, where that is another one.
    """

    study: Text = ""
    scenario: Name
    target_days: Annotated[u.Days, Field(gt=0)]
    factor: Positive
    variant: Name | None = None
    realisations: Annotated[int, Field(ge=1)] | None = None
    note: Text = ""
