"""Types that several rooms share."""

from collections.abc import Callable

Progress = Callable[[str, int, int], None]  # progress(stage, done, total)
