"""Small tables of finished runs, and the pages that quote them: each number has one source.

python studies/paper_tables.py --factors results/linespeed results/traffic results/charges \
    results/linespeed_uncertain results/traffic_uncertain

writes ``docs/tables/NAME.csv`` for each folder, and with --factors ``docs/tables/factors.csv``, the
fitted settlement factors with their Monte Carlo error; then renews the generated tables of the pages and
the numbers in the sentences of ``docs/tables/quoted.toml``. Without arguments only the pages are renewed.
"""

import csv
import io
import re
import sys
import tomllib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from mcsettle.analysis.calibration import calibrate
from mcsettle.estimate.rounding import NOT_REACHED, decimals, is_error, number, with_error
from mcsettle.report.words import percentile
from mcsettle.step_a.processes import cores
from mcsettle.study.study import load_study
from mcsettle.summary.answers import answers
from mcsettle.summary.results import Results, read_results
from mcsettle.summary.summary import summary_rows

ROOT = Path(__file__).resolve().parents[1]
TABLES = ROOT / "docs" / "tables"
MEDIAN = ("p50", "error", "p50_low", "p50_high")
NUMBERS = ("p5", *MEDIAN, "p95", "mean", "mean_low", "mean_high", "published")
OTHERS = ("at", "n", "factor", "settles", "shortens", "sign")
COLUMNS = ("variant", "scenario", "metric", *NUMBERS, *OTHERS)
FITTED = ("calibrated", "linear")
METRICS = {
    "tamping_interval_days": "days",
    "sd_growth_1y_mm": "SD growth in a year, mm",
    "reduction_percent": "reduction, %",
    "elasticity": "elasticity",
    "marginal_cost": "marginal cost",
}
SIGNS = ("roughening_ratio", "break_even_ratio", "leverage")  # why an effect has its sign
PAGES = ("docs/results.md",)  # with generated tables
_BLOCK = re.compile(r"(<!-- table (\w+)((?: \w+)*) -->\n).*?(<!-- end of table -->)", re.DOTALL)
_PLACE = re.compile(r"\{([^}]*)\}")
_NUMBER = r"[−-]?\d+(?:\.\d+)?"

# In the place of a variant: of all the model forms.
OVER_FORMS: dict[str, Callable[[list[float]], float]] = {
    "lowest": min,
    "highest": max,
    "settled": lambda signs: sum(sign != 0.0 for sign in signs),
    "forms": len,
}

Table = dict[tuple[str, str, str], dict[str, str]]


def table_of(results: Results) -> str:
    """The CSV text of a run: quantiles, error, line mean, published value of every metric; ``SIGNS``.

    ``settles`` the median uniform settlement at the end [mm], ``shortens`` the least share of the
    sections whose interval shortens [%], ``sign`` 1, −1 or 0 where it is not settled.
    """
    study, prices = results.study, answers(results).effects
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in summary_rows(results):
        if row.metric not in METRICS and not row.metric.startswith("sd_growth_"):
            continue
        effect = prices.get((row.variant, row.name))
        mean = effect.price if effect is not None and row.metric == "marginal_cost" else None
        middle = row.at(0.5)
        values = [
            *(row.at(0.05).value, middle.value, middle.standard_error),
            *(middle.lower, middle.upper, row.at(0.95).value),
            *((None,) * 3 if mean is None else (mean.value, mean.lower, mean.upper)),
            row.reference.value if row.reference else None,
        ]
        cells = ["" if v is None else f"{v:.6g}" for v in values]
        factor = study.settlement_settings(row.variant).settlement_factor
        key = (row.variant, row.name, row.metric)
        tracks, others = results.part("realisations", row.variant, row.scenario), ["", "", ""]
        if row.metric == "tamping_interval_days":
            others[0] = f"{tracks['mean_settlement_mm'].median():.6g}"
        if effect is not None and row.metric == "reduction_percent":
            others[1:] = [f"{100.0 * effect.shortens[0]:.6g}", str(effect.sign)]
        writer.writerow([*key, *cells, percentile(row), len(tracks), f"{factor:g}", *others])
    if not results.sign_split.empty:
        writer.writerows(_signs(results))
    return stream.getvalue()


def _signs(results: Results) -> Iterator[list[object]]:
    """P5, P50 and P95 of what gives an effect its sign."""
    for (variant, scenario), tracks in results.sign_split.groupby(["variant", "scenario"]):
        for metric in SIGNS:
            low, middle, high = tracks[metric].quantile([0.05, 0.5, 0.95])
            if middle == middle:  # known
                row: dict[str, object] = {
                    "variant": variant,
                    "scenario": scenario,
                    "metric": metric,
                }
                row |= {"p5": f"{low:.6g}", "p50": f"{middle:.6g}", "p95": f"{high:.6g}"}
                yield [(row | {"n": len(tracks)}).get(column, "") for column in COLUMNS]


def factor_table() -> str:
    """The CSV text of the factors that put the median of ``FITTED`` variants at the published days."""
    study = load_study(ROOT / "studies" / "linespeed.toml")
    stream = io.StringIO()
    writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
    writer.writeheader()
    for variant in FITTED:
        fit = calibrate(study, "v201", 697.0, variant, processes=cores())
        ends = {"p50_low": fit.factor_low, "p50_high": fit.factor_high}
        values = {key: f"{end:.6g}" for key, end in {"p50": fit.factor, **ends}.items() if end}
        key = {"variant": variant, "scenario": "v201", "metric": "settlement_factor"}
        writer.writerow({**key, **values, "n": fit.realisations})
    return stream.getvalue()


def read_table(name: str) -> Table:
    """The rows of ``docs/tables/NAME.csv`` by variant, scenario or effect, and metric."""
    text = (TABLES / f"{name}.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(io.StringIO(text))
    return {(row["variant"], row["scenario"], row["metric"]): row for row in rows}


def markdown(name: str, variants: Sequence[str]) -> str:
    """A table for each variant: P5, P50 ± error, P95, and where the published value falls."""
    return "\n".join(_variants(read_table(name), variants))


def _variants(table: Table, variants: Sequence[str]) -> Iterator[str]:
    for variant in variants:
        rows = [row for key, row in table.items() if key[0] == variant and key[2] in METRICS]
        yield (
            f"\n**`{variant}`** ({rows[0]['n']} realisations per scenario, settlement factor "
            f"{rows[0]['factor']})\n"
        )
        yield "| scenario | quantity | P5 | P50 ± s.e. | P95 | published | falls at |"
        yield "|---|---|---|---|---|---|---|"
        yield from (_line(row) for row in rows)
    yield ""


def _line(row: dict[str, str]) -> str:
    low, middle, error, high = (_value(row[key]) for key in ("p5", "p50", "error", "p95"))
    places = decimals(error) if middle and error and is_error(middle, error) else None
    ends = [number(end, places) for end in (low, high)]
    cells = (
        *(row["scenario"], METRICS[row["metric"]], ends[0], with_error(middle, error), ends[1]),
        *(row["published"].replace("-", "−"), row["at"]),
    )
    return "| " + " | ".join(cells) + " |"


def _value(cell: str) -> float | None:
    return float(cell) if cell else None


def quotes() -> list[dict[str, str]]:
    """Page and text of every sentence or row of a table that quotes numbers."""
    text = (TABLES / "quoted.toml").read_text(encoding="utf-8")
    found: list[dict[str, str]] = tomllib.loads(text)["quote"]
    return found


def filled(text: str) -> str:
    """``text`` with its numbers: ``{NAME VARIANT SCENARIO METRIC COLUMN DECIMALS}`` in each place.

    A minus before the column turns the sign; of ``at`` it is the percentile.
    ``OVER_FORMS`` has what may stand for the variant: least and largest, signs that are settled, forms.
    """
    return _PLACE.sub(lambda place: _quoted(place[1]), text)


def _quoted(place: str) -> str:
    name, variant, scenario, metric, column, places = place.split(" ")
    table, key = read_table(name), column.lstrip("-")
    if key == "at":  # "P11 (10–12)", where the values of some are not known
        return table[variant, scenario, metric][key].split()[0].lstrip("P")
    if variant in OVER_FORMS:
        cells = (row[key] for place, row in table.items() if place[1:] == (scenario, metric))
        value: float | None = OVER_FORMS[variant]([float(cell) for cell in cells if cell])
    else:
        value = _value(table[variant, scenario, metric][key])
    if value is None:
        return NOT_REACHED
    return number(-value if column.startswith("-") else value, int(places))


def renewed(page: str, text: str) -> str:
    """A page with its generated tables and quoted numbers as the tables have them.

    Raises
    ------
    ValueError
        A quoted sentence is not there, or there twice.
    """
    text = _BLOCK.sub(
        lambda block: f"{block[1]}{markdown(block[2], block[3].split())}\n{block[4]}", text
    )
    for quote in quotes():
        if quote["page"] != page:
            continue
        # Between the numbers the words stand as they are, lines broken anywhere.
        parts = [re.escape(part) for part in _PLACE.split(quote["text"])[::2]]
        pattern = re.compile(re.sub(r"(\\?\s)+", r"\\s+", f"({_NUMBER})".join(parts)))
        found = list(pattern.finditer(text))
        if len(found) != 1:
            raise ValueError(f"{page}: {len(found)} places say: {quote['text']}")
        values = [_quoted(place) for place in _PLACE.findall(quote["text"])]
        whole, at = found[0], found[0].start()
        new, end = "", at
        for i, value in enumerate(values, 1):
            new += text[end : whole.start(i)] + value
            end = whole.end(i)
        text = text[:at] + new + text[end:]
    return text


def main() -> None:
    """Tables of the folders named, then the pages."""
    TABLES.mkdir(exist_ok=True)
    if "--factors" in sys.argv:
        (TABLES / "factors.csv").write_text(factor_table(), encoding="utf-8")
    for folder in map(Path, (argument for argument in sys.argv[1:] if argument != "--factors")):
        text = table_of(read_results(folder))
        (TABLES / f"{folder.name}.csv").write_text(text, encoding="utf-8")
    for page in dict.fromkeys([*PAGES, *(quote["page"] for quote in quotes())]):
        path = ROOT / page
        path.write_text(renewed(page, path.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
