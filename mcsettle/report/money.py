"""Amounts of money in words: rounded to what their error allows, a saving called a saving."""

import math
from dataclasses import dataclass

from mcsettle.estimate.rounding import number

SIGNS = {
    "GBP": "£", "EUR": "€", "USD": "$", "AUD": "A$", "CAD": "C$", "NZD": "NZ$", "JPY": "¥", "CNY": "CN¥",
    "INR": "₹", "KRW": "₩", "ILS": "₪", "NGN": "₦", "PHP": "₱", "TRY": "₺", "UAH": "₴", "VND": "₫",
}  # fmt: skip
HUNDREDTHS = {"GBP": "pence", **dict.fromkeys(("EUR", "USD", "AUD", "CAD", "NZD"), "cents")}
NAMES = {
    "GBP": "pounds sterling", "EUR": "euros", "USD": "US dollars", "AUD": "Australian dollars",
    "CAD": "Canadian dollars", "NZD": "New Zealand dollars", "CHF": "Swiss francs", "JPY": "yen",
    "SEK": "Swedish kronor", "NOK": "Norwegian kroner", "DKK": "Danish kroner", "INR": "rupees",
}  # fmt: skip
MOST_DIGITS = 2  # significant digits of an amount in a sentence


@dataclass(frozen=True)
class Money:
    """How amounts of one size are written: ``sign`` before, ``word`` after, ``scale`` of the number."""

    sign: str
    word: str
    scale: float

    def text(self, value: float, places: int) -> str:
        """A positive amount.

        >>> Money("", " pence", 100.0).text(0.1234, 0), Money("£", "", 1.0).text(1.5, 1)
        ('12 pence', '£1.5')
        """
        return f"{self.sign}{number(abs(value) * self.scale, places)}{self.word}"


def symbol(currency: str) -> str:
    """What stands before an amount: a sign, or the code and a space.

    >>> symbol("GBP"), symbol("SEK")
    ('£', 'SEK ')
    """
    return SIGNS.get(currency, f"{currency} ")


def money_for(currency: str, amounts: list[float]) -> Money:
    """Whole units, or hundredths where every amount is below one unit."""
    largest = max((abs(amount) for amount in amounts), default=0.0)
    if currency in HUNDREDTHS and 0.0 < largest < 0.995:
        return Money("", f" {HUNDREDTHS[currency]}", 100.0)
    return Money(symbol(currency), "", 1.0)


def places_for(value: float, error: float | None) -> int:
    """Decimals of an amount in a sentence: no finer than its error, two significant digits at most.

    >>> places_for(12.34, 0.5), places_for(0.1234, 0.003), places_for(0.1234, 0.03)
    (0, 2, 2)
    """
    if value == 0.0:
        return 0
    most = MOST_DIGITS - 1 - math.floor(math.log10(abs(value)))
    if not error or error <= 1e-9 * abs(value):
        return max(most, 0)
    return max(min(most, -math.floor(math.log10(error))), 0)


def about(value: float, error: float | None, currency: str) -> str:
    """An amount as it is said, without its sign.

    >>> about(0.1234, 0.01, "GBP"), about(-12.6, 0.4, "GBP"), about(0.4, 0.02, "SEK")
    ('12 pence', '£13', 'SEK 0.40')
    """
    money = money_for(currency, [value])
    error = None if error is None else error * money.scale
    return money.text(value, places_for(value * money.scale, error))


def between(low: float, high: float, currency: str) -> str:
    r"""A range of prices in words; what is below zero is a saving.

    >>> between(-0.07, 0.28, "GBP"), between(0.002, 0.021, "GBP")
    ('between a saving of 7 and a cost of 28 pence', 'between 0.2 and 2.1 pence')
    >>> between(-0.07, -0.02, "GBP")
    'between savings of 2.0 and 7.0 pence'
    """
    money = money_for(currency, [low, high])
    size = max(abs(low), abs(high)) * money.scale
    # The larger end decides: one more digit than it needs would be noise in the smaller.
    places = max(MOST_DIGITS - 1 - math.floor(math.log10(size)), 0) if size else 0
    ends = sorted((abs(low), abs(high)))
    if low < 0.0 <= high:
        first = money.sign + number(-low * money.scale, places)
        return f"between a saving of {first} and a cost of {money.text(high, places)}"
    first = money.sign + number(ends[0] * money.scale, places)
    kind = "between savings of " if high < 0.0 else "between "
    return f"{kind}{first} and {money.text(ends[1], places)}"
