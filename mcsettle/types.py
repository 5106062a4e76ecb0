"""Types that several rooms share."""

from collections.abc import Callable

Progress = Callable[[str, int, int], None]  # progress(stage, done, total)


def silent(stage: str, done: int, total: int) -> None:
    """Progress that nobody is told of: the default of every ``progress``."""
