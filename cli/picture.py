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


def draw(results: "Results", folder: Path, path: Path, force: bool = False) -> None:
    """Draw the variant that stands first in the finished run in ``folder``."""
    from mcsettle.report.curves import fans, spreads, survivals
    from mcsettle.report.figures.results import overview_figure
    from mcsettle.report.figures.style import drawn
    from mcsettle.report.material import Material
    from mcsettle.report.words import unit_words
    from mcsettle.storage.marks import write_marked
    from mcsettle.storage.provenance import read_provenance
    from mcsettle.summary.answers import answers
    from mcsettle.summary.summary import summary_rows

    material = Material(
        results, tuple(summary_rows(results)), answers(results), read_provenance(folder)
    )
    variant = results.study.variant(material.variant)
    costs = spreads(material, "marginal_cost") if material.compared else []
    change = results.study.change(material.compared[0]) if material.compared else None
    label = "" if change is None else f"marginal cost\n[{unit_words(change.unit)}]"
    figure = overview_figure(
        fans(material),
        results.study.limit.sd_limit_mm,
        survivals(material),
        costs,
        label,
        f"{results.study.title}  {variant.name}: {variant.title}".strip(": "),
    )
    path = checked_picture(path)
    write_marked(
        {path: drawn(figure, path.suffix.lower().lstrip("."))}, results.study.identity, force
    )
