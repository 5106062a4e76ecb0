"""Numbers of a study file: plain, or strings with a unit such as ``"70 MPa"``.

Every key ends in the unit it stands for (``youngs_modulus_pa``), and a plain number is in that
unit. A string is read as a number and a unit, converted, and refused where its dimension differs.
Pint is imported only when a string is met.
"""

import re
from collections.abc import Callable
from functools import cache
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

_NUMBER = re.compile(
    r"\s*([+-]?(?:\d{1,30}\.?\d{0,30}|\.\d{1,30})(?:[eE][+-]?\d{1,3})?)\s*(\S.{0,39})?$"
)
_UNIT = re.compile(r"(?!.*\d\s*(?:\^|\*\*))(?:[A-Za-zµμ%·²³/()* ]|(?:\^|\*\*)-?[1-4](?!\d))+")


def in_unit(unit: str) -> Callable[[Any], Any]:
    """Return a converter of strings with a unit into a plain number of ``unit``.

    Anything that is not a string passes through unchanged. The converter raises ``ValueError`` for
    text that is not a number with a unit, or whose unit has another dimension.
    """

    def convert(value: Any) -> Any:
        return _converted(value, unit) if isinstance(value, str) else value

    return convert


def in_plain(unit: str) -> Any:
    """Marker of the unit of a plain number, as it is printed: the ``unit`` of its JSON Schema."""
    return Field(json_schema_extra={"unit": unit})


def quantity(unit: str) -> BeforeValidator:
    """Pydantic validator for a number in ``unit`` that may be written as text with its unit."""
    printed = "d" if unit == "day" else unit.replace("^", "").replace("*", " ")
    received = Annotated[float | str, in_plain(printed)]
    return BeforeValidator(in_unit(unit), json_schema_input_type=received)


def _share(value: Any) -> Any:
    """A share as a number, or as text in per cent."""
    if isinstance(value, str):
        parts = re.fullmatch(r"\s*(\d{1,3}(?:\.\d{1,30})?)\s*%\s*", value)
        if parts is None:
            raise ValueError("is neither a number nor a text such as '3.5 %'")
        return float(parts[1]) / 100.0
    if isinstance(value, int | float) and not isinstance(value, bool) and 1.0 <= value < 100.0:
        raise ValueError(f"is {100.0 * value:g} %: write {value / 100.0:g}, or '{value:g} %'")
    return value


PerCent = BeforeValidator(_share, json_schema_input_type=float | str)
Metres = Annotated[float, quantity("m"), Field(gt=0)]
Millimetres = Annotated[float, quantity("mm"), Field(gt=0)]
Pascals = Annotated[float, quantity("Pa"), Field(gt=0)]
Density = Annotated[float, quantity("kg/m^3"), Field(gt=0)]
Mass = Annotated[float, quantity("kg"), Field(gt=0)]
Tonnes = Annotated[float, quantity("t"), Field(ge=1e-3)]
Inertia = Annotated[float, quantity("kg*m^2"), Field(gt=0)]
SpringStiffness = Annotated[float, quantity("N/m"), Field(gt=0)]
DashpotDamping = Annotated[float, quantity("N*s/m"), Field(ge=0)]
LineStiffness = Annotated[float, quantity("N/m^2"), Field(gt=0)]
LineDamping = Annotated[float, quantity("N*s/m^2"), Field(ge=0)]
Speed = Annotated[float, quantity("km/h"), Field(gt=0, le=600)]
Area = Annotated[float, quantity("m^2"), Field(gt=0)]
SecondMoment = Annotated[float, quantity("m^4"), Field(gt=0)]
Years = Annotated[float, quantity("year"), Field(gt=0)]
Days = Annotated[float, quantity("day"), Field(ge=0)]


def _converted(text: str, unit: str) -> float:
    parts = _NUMBER.match(text)
    if parts is None:
        raise ValueError(f"is not a number in {unit} or a text such as '1.5 {unit}'")
    number, received = float(parts[1]), parts[2]
    if received is None:
        raise ValueError(f"has no unit; write {parts[1]} without quotes, or '{parts[1]} {unit}'")
    return number * _factor(received.strip(), unit)


@cache
def _registry() -> Any:
    from pint import UnitRegistry

    return UnitRegistry()


def _factor(received: str, unit: str) -> float:
    import pint

    if not _UNIT.fullmatch(received):
        raise ValueError(f"has the unit '{received}', which cannot be read; give it in {unit}")
    try:
        return float(_registry().Quantity(1.0, received).to(unit).magnitude)
    except pint.DimensionalityError:
        raise ValueError(f"has the unit '{received}', which is no {unit}") from None
    except Exception:  # pint raises a family of errors, tokenizer errors among them
        raise ValueError(
            f"has the unit '{received}', which is unknown; give it in {unit}"
        ) from None
