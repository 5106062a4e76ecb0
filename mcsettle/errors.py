"""The package's exceptions: what was received, what is accepted, what to do.

Three and no more. ``InputError`` is the user's to mend and never shows a traceback on the command
line; the other two say which part of a computation is missing or has failed.
"""


class InputError(ValueError):
    """A study, file, folder or option that cannot be used; the message says how to mend it."""


class MissingPrecomputationError(RuntimeError):
    """A result of Step A (or of an earlier run) that is needed here and has not been computed."""


class NumericalError(RuntimeError):
    """A computation that did not converge, or produced something that is not a number."""
