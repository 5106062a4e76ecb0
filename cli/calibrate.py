"""``mcsettle calibrate``: the factor for a median, or for the observed SDs of one section."""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mcsettle.cli.options import StudyFile, Variant
from mcsettle.cli.study_file import study_in
from mcsettle.cli.terminal import Progress, cores, plainly, say, warn
from mcsettle.errors import InputError

if TYPE_CHECKING:
    from mcsettle.analysis.forecast import Prediction
    from mcsettle.analysis.posterior import Posterior
    from mcsettle.estimate.observation import Observation
    from mcsettle.study.study import Study


@plainly
def calibrate(
    study: StudyFile,
    scenario: Annotated[str, typer.Option(help="Scenario that is observed.")],
    median_days: Annotated[
        float | None, typer.Option(help="Median tamping interval to meet (days).")
    ] = None,
    observations: Annotated[
        str | None,
        typer.Option(
            help="SDs of a section: CSV file (day or date, sd_mm, sd_error_mm) or d:sd:error,…"
        ),
    ] = None,
    dates: Annotated[
        str, typer.Option(help="Dates of the file: iso, day_first or month_first.")
    ] = "iso",
    hold_out: Annotated[
        int, typer.Option(min=0, help="Observations, the last ones, to predict and not to fit.")
    ] = 0,
    variant: Variant = None,
) -> None:
    """Find the settlement factor that meets a median interval, or the observed SDs of a section."""
    loaded = study_in(study)
    loaded.scenario(scenario)
    if variant is not None:
        loaded.variant(variant)
    if (median_days is None) == (observations is None):
        raise InputError("give either --median-days or --observations")
    if observations is not None:
        from mcsettle.cli.observations import read_observations
        from mcsettle.railway.dates import ORDERS

        if dates not in ORDERS:
            raise InputError(f"--dates is '{dates}'; choose one of {', '.join(ORDERS)}")
        rows = read_observations(observations, dates)
        factor_for_observations(loaded, scenario, rows, variant, hold_out)
    elif median_days is not None:
        factor_for_median(loaded, scenario, median_days, variant)


def factor_for_median(study: "Study", scenario: str, days: float, variant: str | None) -> None:
    """Print the factor that gives a median interval of ``days``."""
    if not (days > 0.0 and math.isfinite(days)):
        raise InputError(f"--median-days is {days:g}; it must be positive and finite")
    from mcsettle.analysis.calibration import calibrate

    calibration = calibrate(
        study, scenario, days, variant=variant, progress=Progress(), processes=cores()
    )
    say("\n".join(calibration_lines(calibration)))


def forecast_lines(predictions: Sequence["Prediction"]) -> Iterator[str]:
    """Predicted and observed SD of every day, as comments of TOML, and the coverage."""
    yield f"# {'day':>8} {'P5':>8} {'P50':>8} {'P95':>8} {'observed':>9}  mm"
    for row in predictions:
        low, middle, high = row.quantiles
        said = "fitted to"
        if row.held_out:
            said = (
                f"held out, {'inside' if row.inside else 'OUTSIDE'} (P{100 * row.percentile:.0f})"
            )
        yield f"# {row.day:>8g} {low:>8.3f} {middle:>8.3f} {high:>8.3f} {row.observed:>9.3f}  {said}"
    held = [row for row in predictions if row.held_out]
    inside = sum(row.inside for row in held)
    yield f"# {inside} of {len(held)} held out lie inside the band of 90 %"


def factor_for_observations(
    study: "Study",
    scenario: str,
    rows: tuple["Observation", ...],
    variant: str | None,
    hold_out: int = 0,
) -> None:
    """Print the posterior of the factor given observed SDs, as TOML to paste.

    The last ``hold_out`` observations are predicted from the others.
    """
    from mcsettle.analysis.posterior import infer_factor

    if hold_out:
        from mcsettle.analysis.forecast import forecast

        arguments = (study, scenario, rows, hold_out, variant, Progress(), cores())
        say("\n".join(forecast_lines(forecast(*arguments))))
        rows = rows[:-hold_out]
    posterior = infer_factor(study, scenario, rows, variant, progress=Progress(), processes=cores())
    for warning in posterior_warnings(posterior):
        warn(f"warning: {warning}")
    say("\n".join(posterior_lines(posterior)))


def calibration_lines(calibration: Any) -> Iterator[str]:
    """A calibration: the factor and what it belongs to as lines of TOML, and what was done."""
    yield f"settlement_factor = {calibration.factor:.6g}"
    yield f'factor_digest = "{calibration.factor_digest}"'
    for field in dataclasses.fields(calibration):
        if field.name not in ("factor", "factor_digest"):
            value = getattr(calibration, field.name)
            yield f"# {field.name}: {f'{value:.6g}' if isinstance(value, float) else value}"


def posterior_lines(posterior: "Posterior") -> Iterator[str]:
    """A posterior: the factor and an uncertain input as TOML to paste, and what to know."""
    low, middle, high = posterior.quantiles
    yield "[settlement]"
    yield f"settlement_factor = {posterior.median:.6g}"
    yield ""
    yield "[[uncertain]]"
    yield 'input = "settlement.settlement_factor"'
    yield 'distribution = "lognormal"'
    yield f"median = {posterior.median:.6g}"
    yield f"log_sd = {posterior.log_sd:.4g}"
    n = len(posterior.observations)
    yield (
        f'source = "posterior from {n} observed SD{"s" if n > 1 else ""}, scenario '
        f"{posterior.scenario}, variant {posterior.variant}, {posterior.realisations} realisations, "
        f'seed {posterior.seed}"'
    )
    yield f"# least squares on the median SD: {posterior.least_squares:.6g}"
    yield f"# posterior P5, P50, P95: {low:.6g}, {middle:.6g}, {high:.6g}"
    yield f"# {posterior.effective:.1f} realisations carry the weight; the best one misses by"
    yield f"# {posterior.misfit:.2g} standard errors (root mean square)"


def posterior_warnings(posterior: "Posterior") -> Iterator[str]:
    """What makes a posterior doubtful."""
    from mcsettle.analysis.posterior import MISFIT
    from mcsettle.estimate.conditioning import FEW

    if posterior.few:
        yield (
            f"only {posterior.effective:.1f} of {posterior.realisations} realisations carry the weight "
            f"(below {FEW:g}): take more realisations, or larger errors if the model cannot be that exact"
        )
    if posterior.misfit > MISFIT:
        yield (
            f"no realisation comes nearer to the observations than {posterior.misfit:.2g} standard "
            "errors: the model cannot produce them with a factor alone"
        )
