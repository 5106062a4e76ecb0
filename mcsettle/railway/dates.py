"""Dates as people write them: ISO, or day or month first when that is said; serials are refused."""

import datetime as dt
import re
from collections.abc import Sequence

ORDERS = ("iso", "day_first", "month_first")
_ISO = re.compile(r"(\d{4})-?(\d{2})-?(\d{2})(?:[T ].*)?$")
_PARTS = re.compile(r"(\d{1,2})[./-](\d{1,2})[./-](\d{4}|\d{2})(?:[T ].*)?$")
_SERIALS = (20_000, 80_000)  # 1954 to 2119
_DAY_ZERO = dt.date(1899, 12, 30)  # of spreadsheets, whose 1900 has a 29 February


def date_of(text: str, order: str) -> dt.date:
    """The date that ``text`` is in ``order`` (one of ``ORDERS``); ISO dates are read in any.

    Raises
    ------
    ValueError
        It is none; what it may be is said.

    Examples
    --------
    >>> date_of("05/03/2021", "day_first").isoformat(), date_of("2021-03-05T10:15", "iso").isoformat()
    ('2021-03-05', '2021-03-05')
    """
    text = text.strip()
    iso, parts = _ISO.match(text), _PARTS.match(text)
    try:
        if iso:
            return dt.date(int(iso[1]), int(iso[2]), int(iso[3]))
        if parts and order != "iso":
            first, second, year = int(parts[1]), int(parts[2]), int(parts[3])
            day, month = (first, second) if order == "day_first" else (second, first)
            return dt.date(year + 2000 if year < 100 else year, month, day)
    except ValueError:
        other = ' (month first: dates = "month_first"?)' if order == "day_first" and parts else ""
        raise ValueError(f"'{text}' is no date of the calendar{other}") from None
    raise ValueError(_not_a_date(text, parts))


def run_dates(names: Sequence[str], order: str) -> tuple[dict[str, str], list[str]]:
    """ISO date of each of ``names`` (the name itself where it is none), and every fault."""
    dates, faults = {}, []
    for name in names:
        try:
            dates[name] = date_of(name, order).isoformat()
        except ValueError as error:
            dates[name] = name
            faults.append(str(error))
    return dates, faults


def looks_dated(text: str) -> bool:
    """Whether ``text`` has the form of a date or of a spreadsheet's serial of one."""
    text = text.strip()
    return bool(_ISO.match(text) or _PARTS.match(text) or _serial(text))


def _not_a_date(text: str, parts: re.Match[str] | None) -> str:
    if parts:
        a, b = int(parts[1]), int(parts[2])
        certain = ' dates = "day_first"' if a > 12 else ' dates = "month_first"' if b > 12 else ""
        return f"'{text}' is not ISO (2021-03-05); say" + (
            certain or ' which comes first, dates = "day_first" or "month_first"'
        )
    serial = _serial(text)
    if serial is not None:
        return (
            f"'{text}' is a spreadsheet's serial number, which would be {serial.isoformat()} (or "
            f"{(serial + dt.timedelta(1462)).isoformat()} where its years start in 1904); export the "
            "column as a date"
        )
    return f"'{text[:40]}' is no date; write it as 2021-03-05"


def _serial(text: str) -> dt.date | None:
    if not re.fullmatch(r"\d{5}(\.\d+)?", text) or not _SERIALS[0] <= float(text) < _SERIALS[1]:
        return None
    return _DAY_ZERO + dt.timedelta(int(float(text)))
