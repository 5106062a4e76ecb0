"""``mcsettle calibrate``: the factor for a median, or for the observed SDs of one section.

Depends on: calibration, errors, inference, study (types), cli.edge, cli.spread, cli.views.
"""

import math

import typer

from mcsettle.cli.edge import Progress, cores, talk
from mcsettle.cli.spread import posterior_lines, posterior_warnings
from mcsettle.cli.views import calibration_lines
from mcsettle.errors import InputError
from mcsettle.study import Study


def factor_for_median(study: Study, scenario: str, days: float, variant: str | None) -> None:
    """Print the factor that gives a median interval of ``days``."""
    if not (days > 0.0 and math.isfinite(days)):
        raise InputError(f"--median-days is {days:g}; it must be positive and finite")
    from mcsettle.calibration import calibrate

    found = calibrate(
        study, scenario, days, variant=variant, progress=Progress(), processes=cores()
    )
    typer.echo("\n".join(calibration_lines(found)))


def factor_for_observations(
    study: Study, scenario: str, observations: str, variant: str | None
) -> None:
    """Print the posterior of the factor given observed SDs, as TOML to paste."""
    from mcsettle.inference import infer_factor, read_observations

    rows = read_observations(observations)
    found = infer_factor(study, scenario, rows, variant, progress=Progress(), processes=cores())
    for warning in posterior_warnings(found):
        talk(f"warning: {warning}")
    typer.echo("\n".join(posterior_lines(found)))
