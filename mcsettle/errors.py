"""The package's exceptions: what was received, what is accepted, what to do.

Three and no more. ``InputError`` is the user's to mend and never shows a traceback on the command
line; the other two say which part of a computation is missing or has failed.
"""

import contextlib
import math
import re
from collections.abc import Iterator


class InputError(ValueError):
    """A study, file, folder or option that cannot be used; the message says how to mend it."""


class MissingPrecomputationError(RuntimeError):
    """A result of Step A (or of an earlier run) that is needed here and has not been computed."""


class NumericalError(RuntimeError):
    """A computation that did not converge, or produced something that is not a number."""


def check_positive(name: str, value: float, unit: str = "") -> None:
    """Refuse a number that is not positive and finite, by a ``ValueError``."""
    if not 0.0 < value < math.inf:
        raise ValueError(f"{name} is {value} {unit}".rstrip() + "; it must be positive and finite")


# How the kernels' compiler and the system's threads say that there is no memory.
_NO_MEMORY = re.compile(r"allocat.* failed|[Cc]annot allocate|Resource temporarily unavailable")


@contextlib.contextmanager
def computing() -> Iterator[None]:
    """Say in words that numbers have left what can be computed, as inputs far from any track make them.

    Raises
    ------
    NumericalError
        Instead of an overflow, a division by zero, or a matrix that is not one of numbers.
    MemoryError
        Instead of a library's own error where memory does not suffice.
    """
    try:
        yield
    except RuntimeError as error:
        if _NO_MEMORY.search(str(error)):
            raise MemoryError(str(error)) from error
        raise
    except (ArithmeticError, ValueError) as error:
        if isinstance(error, ValueError) and type(error).__name__ != "LinAlgError":  # NumPy's
            raise
        raise NumericalError(
            f"the inputs lead to numbers that cannot be computed ({error}); look for one that is far "
            "from any track"
        ) from error
