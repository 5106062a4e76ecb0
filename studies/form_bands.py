"""What every model form says of the scenarios of a run: a Markdown table, and a picture of the bands.

python studies/form_bands.py results/traffic --picture docs/forms.png
"""

import argparse
from pathlib import Path

import matplotlib
import numpy as np

from mcsettle.summary.answers import Answers, answers
from mcsettle.summary.results import Results, read_results

matplotlib.use("Agg")
import matplotlib.pyplot as plt

COLOURS = ("#1f5a94", "#c25a2b", "#4c8c4a")


def known(results: Results, form: str, scenario: str, metric: str) -> np.ndarray:
    """Column ``metric`` of the effects of one form and scenario, of the pairs that are known."""
    table = results.part("effects", form, scenario)
    return table[metric].dropna().to_numpy(dtype=float)


def band(values: np.ndarray) -> np.ndarray:
    """P5, P50 and P95; NaN where nothing is known."""
    return np.quantile(values, (0.05, 0.5, 0.95)) if len(values) else np.full(3, np.nan)


def published(results: Results, scenario: str, metric: str) -> float | None:
    """The paper's value."""
    return next(
        (
            entry.value
            for entry in results.study.reference
            if (entry.metric, entry.scenario) == (metric, scenario)
        ),
        None,
    )


def rows(results: Results, found: Answers, scenarios: list[str]) -> list[str]:
    """One row a form: factor, baseline, then each scenario's reduction, price and sign."""
    assert results.study.economics is not None
    lines, baseline = [], results.study.economics.baseline
    for form in found.forms:
        factor = results.study.settlement_settings(form).settlement_factor
        interval = found.intervals[form, baseline]
        settled = "" if interval.settlement is None else f"{interval.settlement:.3g}"
        days = interval.median.value
        cells = [f"`{form}`", f"{factor:.4g}", settled, "" if days is None else f"{days:.0f}"]
        for scenario in scenarios:
            effect = found.effects[form, scenario]
            low, middle, high = band(known(results, form, scenario, "reduction_percent"))
            price = effect.price
            cost = "bound only" if price.value is None else f"{price.value:.3f}"
            if price.value is not None and price.lower is not None and price.upper is not None:
                cost += f" ({price.lower:.3f} to {price.upper:.3f})"
            cells += [f"{middle:.1f} ({low:.1f} to {high:.1f})", cost, f"{effect.shortens[0]:.0%}"]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def picture(
    results: Results, found: Answers, scenarios: list[str], metric: str, path: Path
) -> None:
    """Bands from P5 to P95 and medians of every form, the published values as vertical lines."""
    height = 1.3 + 0.42 * len(found.forms)
    figure, axes = plt.subplots(figsize=(8.0, height), layout="constrained")
    offsets = np.linspace(-0.16, 0.16, len(scenarios))
    for scenario, offset, colour in zip(scenarios, offsets, COLOURS, strict=False):
        bands = np.array([band(known(results, f, scenario, metric)) for f in found.forms])
        place = np.arange(len(bands)) + offset
        title = results.study.scenario(scenario).title or scenario
        axes.hlines(place, bands[:, 0], bands[:, 2], color=colour, lw=4.0, alpha=0.45)
        axes.plot(bands[:, 1], place, "o", color=colour, ms=5.0, label=f"{scenario}: {title}")
        value = published(results, scenario, metric)
        if value is not None:
            axes.axvline(value, color=colour, ls="--", lw=1.2, label=f"paper, {scenario}")
    axes.axvline(0.0, color="0.3", lw=0.8)
    axes.set_yticks(range(len(found.forms)), [form.replace("_", " ") for form in found.forms])
    axes.invert_yaxis()
    unit = found.effects[found.form, scenarios[0]].price.unit
    label = (
        f"price, {unit}" if metric == "marginal_cost" else "reduction of the tamping interval, %"
    )
    axes.set_xlabel(f"{label} (P5 to P95 of sections, dot: median)")
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside upper center", ncols=2, frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    """Print the table of a run; draw its picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("results", type=Path)
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--scenarios", nargs="+")
    parser.add_argument("--prices", action="store_true", help="in the picture, not reductions")
    options = parser.parse_args()
    results = read_results(options.results)
    found = answers(results)
    scenarios = options.scenarios or list(found.summaries)
    head = "| form | factor | settles, mm | baseline, days |"
    for scenario in scenarios:
        head += f" {scenario}: reduction, % | price | shortens |"
    print(head)
    print("|--" * head.count(" | ") + "|--|")
    print("\n".join(rows(results, found, scenarios)))
    for scenario in scenarios:
        summary = found.summaries[scenario]
        print(f"\n{scenario}: supported: {summary.verdict} ({summary.reason})")
    if options.picture:
        metric = "marginal_cost" if options.prices else "reduction_percent"
        picture(results, found, scenarios, metric, options.picture)


if __name__ == "__main__":
    main()
