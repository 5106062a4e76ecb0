"""The door for notebooks: a finished run as a table and as a picture."""

from typing import TYPE_CHECKING, Any

import numpy as np

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
    """Picture of one variant (the first): SD in time, and tracks tamped by a day, by scenario.

    Raises
    ------
    InputError
        The folder holds no finished run, or there is no such variant.
    """
    from matplotlib.figure import Figure

    from mcsettle.report.figures.style import GREY, look, styled

    held = results if isinstance(results, Results) else read_results(results)
    study = held.study
    name = study.variant(variant or study.variant_names[0]).name

    @styled
    def drawn() -> Figure:
        figure = Figure(figsize=(9.5, 3.8), layout="constrained")
        history, tamped = figure.subplots(1, 2)
        for index, scenario in enumerate(study.scenario_names):
            title = study.scenario(scenario).title or scenario
            _history(history, _part(held.history, name, scenario), held, title, look(index))
            own = _part(held.realisations, name, scenario)
            days = np.sort(own["tamping_interval_days"].to_numpy(float))
            days = days[~np.isnan(days)]
            share = np.arange(1, len(days) + 1) / max(len(own), 1)
            tamped.step(days, share, where="post", label=title, **look(index))
        history.axhline(study.limit.sd_limit_mm, color=GREY, linewidth=0.9)
        history.set(xlabel="days", ylabel="SD [mm], median and P5–P95")
        tamped.set(xlabel="days", ylabel="share of realisations tamped", ylim=(0.0, 1.02))
        tamped.legend()
        figure.suptitle(f"{study.title or 'untitled'}: {name}")
        return figure

    return drawn()


def _part(frame: "pd.DataFrame", variant: str, scenario: str) -> "pd.DataFrame":
    return frame[(frame["variant"] == variant) & (frame["scenario"] == scenario)]


def _history(
    axes: Any, own: "pd.DataFrame", held: Results, title: str, style: dict[str, Any]
) -> None:
    """Median and band; a track that has been tamped stays at the limit."""
    days = sorted({0.0, *held.study.run.history_days})
    own = own[own["day"].isin(days)]
    if own.empty:
        return
    keys = ["parameter_set", "realisation"]
    grid = own.pivot_table(index="day", columns=keys, values="sd_mm")
    grid = grid.fillna(held.study.limit.sd_limit_mm)
    low, middle, high = grid.quantile([0.05, 0.5, 0.95], axis=1).to_numpy()
    axes.fill_between(grid.index, low, high, color=style["color"], alpha=0.12, linewidth=0)
    axes.plot(grid.index, middle, label=title, **style)
