"""The study file as a whole: its tables under the file's names."""

from datetime import date
from functools import cache
from typing import Annotated, Any

from pydantic import ConfigDict, Field

from mcsettle.study.schema.base import FileName, KeyPath, Name, Table, Text
from mcsettle.study.schema.economics import EconomicsTable, EffectTable, MaintenanceTable
from mcsettle.study.schema.grounds import GroundsTable
from mcsettle.study.schema.line import LineTable
from mcsettle.study.schema.observed import ObservedTable
from mcsettle.study.schema.profile import ProfileTable
from mcsettle.study.schema.published import CalibrationTable, ReferenceTable
from mcsettle.study.schema.run import LimitTable, RunTable, SettlementTable
from mcsettle.study.schema.spatial_variability import SpatialVariabilityTable
from mcsettle.study.schema.step_a import StepATable
from mcsettle.study.schema.track import TrackTable
from mcsettle.study.schema.traffic import ScenarioTable, TrainTable, VehicleTable
from mcsettle.study.schema.uncertain import CorrelationTable, UncertainTable
from mcsettle.study.schema.variants import VariantTable

SCHEMA_VERSION = 1


class StudyTables(Table):
    """One study file. Tables keep the file's keys and units."""

    model_config = ConfigDict(title="Study")

    schema_version: Annotated[int, Field(ge=1, le=SCHEMA_VERSION)]
    title: Text = ""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 1
    start_date: Annotated[date, Field(strict=False)] | None = None
    track_table: TrackTable = Field(default=TrackTable(), alias="track")
    profile: ProfileTable = ProfileTable()
    settlement: SettlementTable = SettlementTable()
    spatial_variability: SpatialVariabilityTable | None = None
    limit: LimitTable
    run: RunTable = RunTable()
    step_a_table: StepATable | None = Field(default=None, alias="step_a")
    economics: EconomicsTable | None = None
    effect_tables: Annotated[tuple[EffectTable, ...], Field(max_length=1000)] = Field(
        default=(), alias="effects"
    )
    maintenance: MaintenanceTable | None = None
    train_tables: dict[Name, TrainTable] = Field(alias="trains", min_length=1, max_length=50)
    vehicle_tables: dict[Name, VehicleTable] = Field(default={}, alias="vehicles", max_length=100)
    line: LineTable | None = None
    grounds_table: GroundsTable | None = Field(default=None, alias="grounds")
    include: Annotated[tuple[FileName, ...], Field(max_length=20)] = ()
    scenarios: Annotated[tuple[ScenarioTable, ...], Field(min_length=1, max_length=200)]
    variants: Annotated[tuple[VariantTable, ...], Field(min_length=1, max_length=50)] = (
        VariantTable(name="base"),
    )
    reference: Annotated[tuple[ReferenceTable, ...], Field(max_length=1000)] = ()
    calibration: CalibrationTable | None = None
    files_outside: bool = False
    sources: dict[KeyPath, Text] = Field(default={}, max_length=500)
    uncertain: Annotated[tuple[UncertainTable, ...], Field(max_length=100)] = ()
    correlations: Annotated[tuple[CorrelationTable, ...], Field(max_length=1000)] = ()
    observed: Annotated[tuple[ObservedTable, ...], Field(max_length=1000)] = ()
    stated: Annotated[tuple[KeyPath, ...], Field(max_length=20_000)] = ()  # written by the program

    @property
    def scenario_names(self) -> tuple[str, ...]:
        """Names of the scenarios, in the order of the file."""
        return tuple(scenario.name for scenario in self.scenarios)

    @property
    def variant_names(self) -> tuple[str, ...]:
        """Names of the variants, in the order of the file."""
        return tuple(variant.name for variant in self.variants)

    @property
    def softens(self) -> bool:
        """Whether the soil of any variant is equivalent-linear."""
        return any((v.soil or self.track_table.soil) != "linear" for v in self.variants)

    @property
    def nested(self) -> bool:
        """Whether the study has parameter sets: uncertain inputs, or several grounds."""
        return bool(self.uncertain) or self.grounds_table is not None

    @property
    def predicts_grounds(self) -> bool:
        """Whether the transfer functions of parameter sets may be predicted."""
        return self.step_a_table is not None and self.step_a_table.surrogate


@cache
def json_schema() -> dict[str, Any]:
    """JSON Schema of study files, for editors that complete and check TOML."""
    schema = StudyTables.model_json_schema(by_alias=True)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
