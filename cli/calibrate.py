"""``mcsettle calibrate``: the factor for a median, or for the observed SDs of one section."""

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import typer

from mcsettle.cli.spread import posterior_lines, posterior_warnings
from mcsettle.cli.summarise import calibration_lines
from mcsettle.cli.terminal import Progress, cores, talk
from mcsettle.errors import InputError
from mcsettle.study.study import Study

if TYPE_CHECKING:
    from mcsettle.analysis.forecast import Prediction


def factor_for_median(study: Study, scenario: str, days: float, variant: str | None) -> None:
    """Print the factor that gives a median interval of ``days``."""
    if not (days > 0.0 and math.isfinite(days)):
        raise InputError(f"--median-days is {days:g}; it must be positive and finite")
    from mcsettle.analysis.calibration import calibrate

    found = calibrate(
        study, scenario, days, variant=variant, progress=Progress(), processes=cores()
    )
    typer.echo("\n".join(calibration_lines(found)))


def forecast_lines(found: Sequence["Prediction"]) -> Iterator[str]:
    """Predicted and observed SD of every day, as comments of TOML, and the coverage."""
    yield f"# {'day':>8} {'P5':>8} {'P50':>8} {'P95':>8} {'observed':>9}  mm"
    for row in found:
        low, middle, high = row.quantiles
        said = "fitted to"
        if row.held_out:
            said = (
                f"held out, {'inside' if row.inside else 'OUTSIDE'} (P{100 * row.percentile:.0f})"
            )
        yield f"# {row.day:>8g} {low:>8.3f} {middle:>8.3f} {high:>8.3f} {row.observed:>9.3f}  {said}"
    held = [row for row in found if row.held_out]
    inside = sum(row.inside for row in held)
    yield f"# {inside} of {len(held)} held out lie inside the band of 90 %"


def factor_for_observations(
    study: Study, scenario: str, observations: str, variant: str | None, hold_out: int = 0
) -> None:
    """Print the posterior of the factor given observed SDs, as TOML to paste.

    The last ``hold_out`` observations are predicted from the others.
    """
    from mcsettle.analysis.posterior import infer_factor
    from mcsettle.cli.observations import read_observations

    rows = read_observations(observations)
    if hold_out:
        from mcsettle.analysis.forecast import forecast

        own = (study, scenario, rows, hold_out, variant, Progress(), cores())
        typer.echo("\n".join(forecast_lines(forecast(*own))))
        rows = rows[:-hold_out]
    found = infer_factor(study, scenario, rows, variant, progress=Progress(), processes=cores())
    for warning in posterior_warnings(found):
        talk(f"warning: {warning}")
    typer.echo("\n".join(posterior_lines(found)))
