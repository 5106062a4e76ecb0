"""How a number and its error are written: digits follow the error, the same everywhere.

An error has two significant digits and its value ends at the same decimal; an error below a
billionth of its value is rounding noise and not written.
"""

import math

NOT_REACHED = "not reached"
DIGITS = 3  # of a number without an error
NOISE = 1e-9  # of the value: an error below it is none
FIXED = (1e-3, 1e6)  # outside this range a number has an exponent


def number(
    value: float | None, places: int | None = None, empty: str = NOT_REACHED, digits: int = DIGITS
) -> str:
    """A number with ``places`` decimals, or where they are None ``digits`` significant digits.

    What is None, NaN or infinite is ``empty``.

    >>> number(-0.12345), number(1234.5), number(0.5, 1), number(1463.2, -1), number(None)
    ('−0.123', '1230', '0.5', '1460', 'not reached')
    >>> number(0.0000004032)
    '4.03e−7'
    """
    if value is None or not math.isfinite(value):
        return empty
    if places is not None or value == 0.0:
        return _fixed(value, places or 0)
    if not _power(value):
        return _fixed(value, decimals(value, digits))
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    return mantissa.replace("-", "−") + _exponent(int(power))


def with_error(
    value: float | None, error: float | None, empty: str = NOT_REACHED, factor: float = 1.0
) -> str:
    """Value ± error, both times ``factor``, to two digits of the error.

    >>> with_error(1463.2, 283.1), with_error(0.13136, 0.00213), with_error(0.5, 1.5e-15)
    ('1460 ± 280', '0.1314 ± 0.0021', '0.500')
    >>> with_error(4.032e-7, 1.2e-8)
    '(4.03 ± 0.12)e−7'
    """
    if value is None or error is None or not is_error(value, error):
        return number(None if value is None else value * factor, empty=empty)
    value, error = value * factor, error * abs(factor)
    power = _power(max(abs(value), error))
    value, error = value / 10.0**power, error / 10.0**power
    places = decimals(error)
    text = f"{_fixed(value, places)} ± {_fixed(error, places)}"
    return f"({text}){_exponent(power)}" if power else text


def is_error(value: float, error: float | None) -> bool:
    """Whether ``error`` says something of ``value``: it is there, finite, and no rounding noise."""
    return error is not None and math.isfinite(error) and error > NOISE * abs(value)


def decimals(value: float, digits: int = 2) -> int:
    """Decimals that leave ``value`` (not 0) ``digits`` significant digits; negative: tens, hundreds.

    >>> decimals(11.24), decimals(0.00213), decimals(283.1), decimals(9.96)
    (0, 4, -1, 0)
    """
    return digits - 1 - int(f"{value:.{digits - 1}e}".partition("e")[2])


def _fixed(value: float, places: int) -> str:
    rounded = round(value, places) + 0.0  # no negative zero
    return f"{rounded:.{max(places, 0)}f}".replace("-", "−")


def _power(value: float) -> int:
    """Power of ten to take out of ``value``: 0 within the range of fixed decimals."""
    low, high = FIXED
    return 0 if low <= abs(value) < high else math.floor(math.log10(abs(value)))


def _exponent(power: int) -> str:
    return f"e{power}".replace("-", "−") if power else ""
