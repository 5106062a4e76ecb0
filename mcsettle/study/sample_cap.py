"""A cap on the sample size of every study that is read: any command, printed anywhere, in seconds."""

import os

from mcsettle.errors import InputError

VARIABLE = "MCSETTLE_REALISATIONS"


def sample_cap() -> int | None:
    """The most realisations, and parameter sets, of a study that is read; None: as it says.

    Raises
    ------
    InputError
        The variable is no whole number from 1.
    """
    text = os.environ.get(VARIABLE)
    if not text:
        return None
    if not (text.isascii() and text.isdigit() and int(text) > 0):
        raise InputError(f"{VARIABLE} is {text[:40]!r}; it takes a whole number from 1, or nothing")
    return int(text)


def capped(n: int) -> int:
    """``n`` realisations or parameter sets, or as many as ``sample_cap`` allows.

    Raises
    ------
    InputError
        As ``sample_cap``.
    """
    cap = sample_cap()
    return n if cap is None else min(n, cap)
