"""Lines on uncertainty: what the spread consists of, lines of track, tornado, convergence, posterior."""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape

from mcsettle.cli.tables import UNKNOWN, add_numbers, console, shown, table
from mcsettle.estimate.rounding import number

if TYPE_CHECKING:
    from mcsettle.analysis.posterior import Posterior
    from mcsettle.analysis.tornado import Bar
    from mcsettle.estimate.estimate import Estimate, Statistic
    from mcsettle.run.stopping import Batch, Target
    from mcsettle.summary.summary import SummaryRow


def print_spread(rows: "list[SummaryRow]") -> None:
    """Tables of one variant: variance split and indices, pairing, and the mean along a line."""
    out = console()
    split = table("What the spread consists of, share of the variance [%]", "scenario", "metric")
    add_numbers(split, "parameters", "sections", "interaction", "pairing gain", "correlation")
    for row in rows:
        cells = [_share(row, "variance_share", part) for part in
                 ("parameters", "sections", "interaction")]  # fmt: skip
        cells += [_share(row, kind, "", 1.0) for kind in ("pairing_gain", "correlation")]
        if any(cells):
            split.add_row(row.scenario, row.metric, *cells)
    if split.row_count:
        out.print(split)
    lines = list(_index_lines(rows))
    for line in lines:
        out.print(line, markup=False)
    if not lines and any(s.statistic == "variance_share" for row in rows for s in row.spread):
        from mcsettle.estimate.variance import LEAST_SETS

        out.print(f"Indices of single inputs: from {LEAST_SETS} parameter sets on.")
    _print_lines(out, rows)


def print_tornado(bars: "list[Bar]") -> None:
    """One table on stdout: medians at P10 and P90 of each input, the others central."""
    title = "Medians with one input at its P10 and its P90, the others central"
    medians = table(title, "scenario", "metric", "input", "P10", "P90")
    add_numbers(medians, "at P10", "central", "at P90")
    previous: tuple[str, str] = ("", "")
    for bar in bars:
        head = (bar.scenario, bar.metric)
        cells = [shown(v) for v in (bar.low, bar.high, bar.at_low, bar.central, bar.at_high)]
        medians.add_row(*(head if head != previous else ("", "")), bar.input, *cells)
        previous = head
    console().print(medians)


def tornado_json(bars: "list[Bar]") -> str:
    """Every bar as JSON."""
    import dataclasses
    import json

    return json.dumps([dataclasses.asdict(bar) for bar in bars], indent=1, ensure_ascii=False)


def batch_line(batch: "Batch", target: "Target | None") -> str:
    """One row of the convergence table."""
    text = f"{batch.realisations:>9} realisations  {batch.seconds:8.1f} s"
    if target is None:
        return text
    error = "unknown" if batch.error is None else f"{100.0 * batch.error:.2f} %"
    aim = f"{100.0 * target.tolerance:g} %"
    return f"{text}  standard error {error:>8} of {aim} ({target.metric}, {batch.where})"


def posterior_lines(found: "Posterior") -> Iterator[str]:
    """A posterior: the factor and an uncertain input as TOML to paste, and what to know."""
    low, middle, high = found.quantiles
    yield "[settlement]"
    yield f"settlement_factor = {found.median:.6g}"
    yield ""
    yield "[[uncertain]]"
    yield 'input = "settlement.settlement_factor"'
    yield 'distribution = "lognormal"'
    yield f"median = {found.median:.6g}"
    yield f"log_sd = {found.log_sd:.4g}"
    n = len(found.observations)
    yield (
        f'source = "posterior from {n} observed SD{"s" if n > 1 else ""}, scenario '
        f'{found.scenario}, variant {found.variant}, {found.realisations} tracks, seed {found.seed}"'
    )
    yield f"# least squares on the median SD: {found.least_squares:.6g}"
    yield f"# posterior P5, P50, P95: {low:.6g}, {middle:.6g}, {high:.6g}"
    yield f"# {found.effective:.1f} tracks carry the weight; the best one misses by"
    yield f"# {found.misfit:.2g} standard errors (root mean square)"


def posterior_warnings(found: "Posterior") -> Iterator[str]:
    """What makes a posterior doubtful."""
    from mcsettle.analysis.posterior import FEW, MISFIT

    if found.few:
        yield (
            f"only {found.effective:.1f} of {found.realisations} tracks carry the weight (below "
            f"{FEW:g}): take more realisations, or larger errors if the model cannot be that exact"
        )
    if found.misfit > MISFIT:
        yield (
            f"no track comes nearer to the observations than {found.misfit:.2g} standard errors: "
            "the model cannot produce them with a factor alone"
        )


def statistics_json(statistics: "Iterable[Statistic]") -> list[dict[str, Any]]:
    """Statistics with their estimates as plain data."""
    import dataclasses

    return [
        {
            "statistic": s.statistic,
            "subject": s.subject,
            "level": s.level,
            **dataclasses.asdict(s.estimate),
        }
        for s in statistics
    ]


def _print_lines(out: Console, rows: "list[SummaryRow]") -> None:
    """Mean interval and mean cost over lines of several lengths, each with its 95 % interval."""
    title = "Mean over a line of independent sections, [95 % interval of the Monte Carlo error]"
    means = table(title, "scenario", "metric")
    add_numbers(
        means, "line", "P5", "P50", "P95", "mean", "median section", "cost at mean interval"
    )
    for row in rows:
        of_line = [s for s in row.spread if s.statistic == "line_mean"]
        named = [row.scenario, row.metric]
        ends = [shown(row.at(0.5).value), _share(row, "cost_at_mean_interval", "", 1.0)]
        for length in dict.fromkeys(s.subject for s in of_line):
            cells = [_ranged(s.estimate) for s in of_line if s.subject == length]
            means.add_row(*named, length, *cells, *ends)
            named, ends = ["", ""], ["", ""]
    if not means.row_count:
        return
    out.print(means)
    for note in dict.fromkeys(s.estimate.note for r in rows for s in r.spread if s.subject):
        if note.startswith("restricted"):
            out.print(f"Intervals are {note}: sections that last longer count with it.")
    out.print(
        "A line's price is the mean of its sections' costs. Uncertain inputs are the same all along "
        "a line, so their spread stays. Open: too few parameter sets or tracks to say how far.",
        markup=False,
    )


def _ranged(estimate: "Estimate") -> str:
    """A value and under it its interval."""
    if estimate.value is None:
        return UNKNOWN
    ends = (number(end, empty="open") for end in (estimate.lower, estimate.upper))
    return f"{number(estimate.value)}\n" + escape(f"[{', '.join(ends)}]")


def _index_lines(rows: "list[SummaryRow]") -> Iterator[str]:
    """First-order and total indices, the largest first, a line of each for every metric."""
    kinds = {"first_order_index": "first-order", "total_index": "total"}
    for row in rows:
        for kind, name in kinds.items():
            found = [s for s in row.spread if s.statistic == kind]
            found.sort(key=lambda s: -(s.estimate.value or 0.0))
            if not found:
                continue
            parts = ", ".join(_index(s) for s in found[:4])
            if all(s.estimate.value is None for s in found):
                parts = f"not known ({found[0].estimate.note})"
            yield f"{row.scenario} {row.metric}, {name} indices [%]: {parts}"


def _index(statistic: "Statistic") -> str:
    return f"{statistic.subject} {statistic.estimate.with_error(UNKNOWN, 100.0)}"


def _share(row: "SummaryRow", kind: str, subject: str, factor: float = 100.0) -> str:
    for s in row.spread:
        if s.statistic == kind and s.subject == subject:
            return s.estimate.with_error(UNKNOWN, factor)
    return ""
