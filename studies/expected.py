"""Print finished runs as the Markdown tables of ``studies/README.md``.

python studies/expected.py results/linespeed results/traffic
"""

import sys
from pathlib import Path

from mcsettle.report.words import level, percentile
from mcsettle.summary.results import Results, read_results
from mcsettle.summary.summary import SummaryRow, summary_rows

METRICS = {
    "tamping_interval_days": "days",
    "reduction_percent": "reduction, %",
    "elasticity": "elasticity",
    "marginal_cost": "marginal cost, £",
    "sd_growth_1y_mm": "SD growth in a year, mm",
}


def main() -> None:
    """One table a run and variant: P5 / P50 ± error / P95, and where the published value falls."""
    for folder in sys.argv[1:]:
        results = read_results(Path(folder))
        rows = summary_rows(results)
        for variant in results.study.variants:
            own = [r for r in rows if r.variant == variant.name and r.metric in METRICS]
            print(
                f"\n**{results.study.title}**, `{variant.name}` ({counts(results, variant.name)})\n"
            )
            print("| scenario | quantity | P5 | P50 ± s.e. | P95 | published | falls at |")
            print("|---|---|---|---|---|---|---|")
            for row in own:
                print(line(row))


def counts(results: Results, variant: str) -> str:
    """Realisations a scenario, and the factor."""
    table = results.realisations[results.realisations["variant"] == variant]
    n = len(table) // max(table["scenario"].nunique(), 1)
    factor = results.study.settlement_settings(variant).settlement_factor
    return f"{n} realisations per scenario, settlement factor {factor:g}"


def line(row: SummaryRow) -> str:
    """One row of the table."""
    low, middle, high = level(row, 0.05), row.at(0.5).with_error(), level(row, 0.95)
    published = f"{row.reference.value:g}" if row.reference else ""
    cells = (row.scenario, METRICS[row.metric], low, middle, high, published, percentile(row))
    return "| " + " | ".join(cells) + " |"


if __name__ == "__main__":
    main()
