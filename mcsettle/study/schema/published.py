"""``[[reference]]`` and ``[calibration]``: published values beside the study's own."""

from typing import Annotated, Literal

from pydantic import Field

from mcsettle.study.schema.base import Name, Positive, Table, Text
from mcsettle.study.schema.quantities import Days

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

EFFECT_METRICS = ("reduction_percent", "elasticity", "marginal_cost", "mgt_increase_percent")


class ReferenceTable(Table):
    """``[[reference]]``: a published value to print beside the study's own.

    ``note`` says why the two differ; ``baseline``: of an effect, where the scenario has several.
    """

    metric: METRICS
    scenario: Name
    baseline: Name | None = None
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
    target_days: Annotated[Days, Field(gt=0)]
    factor: Positive
    variant: Name | None = None
    realisations: Annotated[int, Field(ge=1)] | None = None
    note: Text = ""
