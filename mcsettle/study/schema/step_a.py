"""``[step_a]``: whether transfer functions of grounds are predicted from those of other grounds."""

from typing import Annotated

from pydantic import Field

from mcsettle.study.schema.base import Table


class StepATable(Table):
    """``[step_a]``: with ``surrogate`` the grounds of most parameter sets are predicted.

    A set is predicted where 95 % of the errors stay below ``tolerance_percent`` of its days and
    ``tolerance_points`` of its effects; at most ``most_grounds`` are computed to learn from.
    """

    surrogate: bool = False
    tolerance_percent: Annotated[float, Field(gt=0, le=100)] = 4.0
    tolerance_points: Annotated[float, Field(gt=0, le=100)] = 2.0
    most_grounds: Annotated[int, Field(ge=4, le=10_000)] = 80
