"""The door for notebooks: a finished run as a table and as a picture."""

from typing import TYPE_CHECKING, Any

from mcsettle.storage.location import Where
from mcsettle.summary.results import Results, read_results
from mcsettle.summary.summary import summary_rows

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


def summarise(results: Results | Where) -> "pd.DataFrame":
    """Summary of a finished run, one row a variant, scenario and metric.

    Parameters
    ----------
    results : Results, or the folder of a run

    Returns
    -------
    DataFrame
        ``p5``, ``p50`` with ``standard_error``, ``p95`` in ``unit`` (None: beyond the horizon), ``n`` and
        ``n_censored``.

    Raises
    ------
    InputError
        The folder holds no finished run.
    """
    import pandas as pd

    held = results if isinstance(results, Results) else read_results(results)
    rows: list[dict[str, Any]] = []
    for row in summary_rows(held):
        low, middle, high = (row.at(level) for level in (0.05, 0.5, 0.95))
        rows.append(
            {
                "variant": row.variant,
                "scenario": row.scenario,
                "baseline": row.baseline,
                "metric": row.metric,
                "p5": low.value,
                "p50": middle.value,
                "standard_error": middle.standard_error,
                "p95": high.value,
                "unit": middle.unit,
                "n": middle.n,
                "n_censored": middle.n_censored,
            }
        )
    return pd.DataFrame(rows)


def plot(results: Results | Where, variant: str | None = None) -> "Figure":
    """Picture of one variant (the first model form): SD in time, tracks not yet tamped, prices.

    SD: medians of every scenario, P5 to P95 and quartiles of the first; a tamped track stays at the
    limit.

    Raises
    ------
    InputError
        The folder holds no finished run, or there is no such variant.
    """
    from mcsettle.report.curves import fans, spreads, survivals
    from mcsettle.report.figures.results import overview_figure
    from mcsettle.report.material import for_pictures
    from mcsettle.report.words import unit_words

    held = results if isinstance(results, Results) else read_results(results)
    material, study = for_pictures(held, variant), held.study
    shown = study.variant(material.variant)
    costs = spreads(material, "marginal_cost", dots=True) if material.compared else []
    change = study.change(material.compared[0]) if material.compared else None
    label = "" if change is None else f"marginal cost\n[{unit_words(change.unit)}]"
    name = shown.name if len(study.variant_names) > 1 else ""
    form = ": ".join(part for part in (name, shown.title) if part)
    title = " · ".join(part for part in (study.title or "untitled", form) if part)
    return overview_figure(
        fans(material), study.limit.sd_limit_mm, survivals(material), costs, label, title
    )
