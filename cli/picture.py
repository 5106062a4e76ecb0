"""The picture beside a summary: SD in time, survival of the interval, marginal costs of one variant."""

from pathlib import Path
from typing import TYPE_CHECKING

from mcsettle.cli.terminal import refuse_url
from mcsettle.errors import InputError

if TYPE_CHECKING:
    from mcsettle.summary.results import Results

FORMATS = (".png", ".svg", ".pdf")


def checked_picture(path: Path) -> Path:
    """``path`` if its ending names a picture format.

    Raises
    ------
    InputError
        It does not.
    """
    refuse_url(path, "--picture")
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"--picture {path}: choose a name that ends in {', '.join(FORMATS)}")
    return path


def draw(results: "Results", path: Path, force: bool = False) -> None:
    """Draw the variant that stands first in a finished run."""
    from mcsettle.report.figures.style import drawn
    from mcsettle.report.notebook import plot
    from mcsettle.storage.marks import write_marked

    path = checked_picture(path)
    picture = drawn(plot(results), path.suffix.lower().lstrip("."))
    write_marked({path: picture}, results.study.identity, force)
