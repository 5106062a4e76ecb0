"""How far the numbers can be trusted: sensitivity, convergence, censoring, calibration."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from mcsettle.estimate.estimate import Estimate
from mcsettle.estimate.rounding import number
from mcsettle.report.curves import convergence
from mcsettle.report.figures.results import Swing, convergence_figure
from mcsettle.report.figures.track_in_time import swings_figure
from mcsettle.report.material import Material
from mcsettle.report.page import Block, Bullets, Picture, Table, Text
from mcsettle.report.words import band, cut, level, metric_words, unit_words, unknown_of
from mcsettle.summary.results import INTERVAL

if TYPE_CHECKING:
    from mcsettle.analysis.tornado import Bar

MOST_BARS = 10
SHOWN = ("quantile", "mean", "restricted_mean", "section_mean")
SHARES = ("parameters", "sections", "interaction")


def sensitivity_blocks(material: Material, bars: "Sequence[Bar]") -> Iterator[Block]:
    """Variance split, first-order indices, tornado; and what else moves the answer."""
    rows = material.of(material.variant)
    split = []
    for row in rows:
        shares = {s.subject: s.estimate for s in row.part("variance_share")}
        if shares:
            cells = (shares[part].with_error("", 100.0) for part in SHARES)
            split.append((row.name, metric_words(row.metric), *cells))
    if split:
        head = ("scenario", "quantity", *SHARES)
        note = (
            "Shares of the variance, %: between parameter sets, between realisations, and both "
            "together."
        )
        yield Table("What the spread consists of", head, tuple(split), 2, note)
    yield from _indices(material)
    yield from _tornado(bars)
    if not material.study.uncertain:
        yield Text(
            "No input of this study is uncertain, so there are no indices and there is no tornado. "
            "What the choice of model does is told by the variants among the results.",
            "note",
        )
    elif not bars:
        yield Text(
            "A tornado (each input at its P10 and P90, the others central) is drawn with "
            "'mcsettle report DIR --tornado'.",
            "note",
        )
    yield from _pairing(material)
    yield from _lines(material)


def _indices(material: Material) -> Iterator[Block]:
    """First-order indices of the answer's metric: a picture and a table."""
    for row in material.of(material.variant):
        indices = row.part("first_order_index")
        if not indices:
            continue
        indices.sort(key=lambda s: -(s.estimate.value or 0.0))
        cells = tuple((cut(s.subject, 80), s.estimate.with_error("", 100.0)) for s in indices)
        name = f"{row.name}, {metric_words(row.metric)}"
        names = _short_names([s.subject for s in indices])
        swings = [
            Swing(names[s.subject], 0.0, 100.0 * (s.estimate.value or 0.0),
                  100.0 * (s.estimate.standard_error or 0.0))
            for s in indices[:MOST_BARS]
        ]  # fmt: skip
        figure = swings_figure(swings, None, "first-order index [% of the variance]")
        alt = f"First-order indices, {name}: " + "; ".join(
            f"{a} {b} %" for a, b in cells[:MOST_BARS]
        )
        key = f"index-{row.name}-{row.metric}".replace(" ", "-")
        yield Picture(key, figure, alt + ".", f"First-order indices: {name}. Bars: ± one error.")
        yield Table(f"First-order indices: {name}", ("input", "% of the variance"), cells, 1,
                    small=True)  # fmt: skip


def _short_names(paths: Sequence[str]) -> dict[str, str]:
    """The ends of key paths that tell them apart, in words: as many steps as it takes."""
    names = {}
    for path in paths:
        steps = path.split(".")
        others = [other.split(".") for other in paths if other != path]
        n = next(
            (n for n in range(1, len(steps)) if all(o[-n:] != steps[-n:] for o in others)),
            len(steps),
        )
        names[path] = " ".join(steps[-n:]).replace("_", " ")
    return names


def _tornado(bars: "Sequence[Bar]") -> Iterator[Block]:
    groups: dict[tuple[str, str], list[Bar]] = {}
    for bar in bars:
        groups.setdefault((bar.scenario, bar.metric), []).append(bar)
    for (scenario, metric), group in groups.items():
        name = f"{scenario}, {metric_words(metric)}"
        centre, drawn, unknown = group[0].central, [], []
        names = _short_names([bar.input for bar in group])
        for bar in group[:MOST_BARS]:
            if bar.at_low is None or bar.at_high is None:
                unknown.append(names[bar.input])
            else:
                drawn.append(Swing(names[bar.input], bar.at_low, bar.at_high))
        if centre is not None and drawn:
            figure = swings_figure(drawn, centre, f"median, {unit_words(group[0].unit) or '1'}")
            alt = f"Tornado of {name}, median {number(centre)}: " + "; ".join(
                f"{s.label} {number(s.low)} to {number(s.high)}" for s in drawn
            )
            text = f"Tornado: {name}."
            if unknown:
                text += f" Not drawn, an end being not reached: {', '.join(unknown)}."
            yield Picture(f"tornado-{scenario}-{metric}".replace(" ", "-"), figure, alt + ".", text)
        rows = tuple(
            (
                cut(b.input, 80),
                *(number(v) for v in (b.low, b.high, b.at_low, b.central, b.at_high)),
            )
            for b in group
        )
        head = ("input", "P10", "P90", "median at P10", "central", "median at P90")
        yield Table(f"Tornado: {name}", head, rows, 1, small=True)


def _pairing(material: Material) -> Iterator[Block]:
    rows = []
    for row in material.of(material.variant):
        estimates = {s.statistic: s.estimate for s in row.spread}
        if "pairing_gain" in estimates:
            gain, correlation = estimates["pairing_gain"], estimates.get("correlation")
            value = None if correlation is None else correlation.value
            rows.append((row.name, gain.with_error(gain.note), number(value, 3, "")))
    if rows:
        note = (
            "Gain: variance of the logarithm of the ratio of two intervals of different "
            "realisations over "
            "that of the same realisation. Correlation: of the logarithms."
        )
        head = ("scenario", "variance gain", "correlation")
        yield Table("What pairing the same realisations gains", head, tuple(rows), 1, note)


def _lines(material: Material) -> Iterator[Block]:
    """Distribution of the mean over lines of several lengths."""
    rows: list[tuple[str, ...]] = []
    for row in material.of(material.variant):
        lines = row.part("line_mean")
        if not lines:
            continue
        rows.append((f"{row.name}, {metric_words(row.metric)}, {unit_words(row.unit)}",))
        for length in dict.fromkeys(s.subject for s in lines):
            rows.append(
                (length, *(s.estimate.with_interval() for s in lines if s.subject == length))
            )
    if rows:
        note = (
            "P5, P50, P95 and mean of the mean over a line of independent sections, each with the 95 % "
            "interval of its Monte Carlo error; open: too few parameter sets or realisations "
            "to say how far. "
            "A price is for a line: the spread between sections averages out along it, that of "
            "uncertain inputs does not."
        )
        head = ("length", "P5", "P50", "P95", "mean")
        yield Table("Means over a line", head, tuple(rows), 1, note, small=True)


def convergence_blocks(material: Material) -> Iterator[Block]:
    """How the median settles as the sample grows, and the Monte Carlo error of the answer."""
    curves = convergence(material)
    if curves and any(len(c.counts) > 1 for c in curves):
        alt = "Median interval against the number of realisations: " + "; ".join(
            f"{cut(c.label, 40)} from {c.value[0]:.0f} to {c.value[-1]:.0f} days" for c in curves
        )
        text = "Median interval of the first n realisations, with its 95 % interval."
        figure = convergence_figure(curves, "median interval [days]")
        yield Picture("convergence", figure, alt + ".", text)
    rows: list[tuple[str, ...]] = []
    for row in material.of(material.variant):
        rows.append((f"{row.name}, {metric_words(row.metric)}",))
        for statistic in (*row.statistics, *row.spread):
            if statistic.statistic not in SHOWN:
                continue
            estimate, at = statistic.estimate, statistic.level
            name = statistic.statistic.replace("_", " ") if at is None else f"P{100 * at:.0f}"
            rows.append((name, *_with_limits(estimate, unknown_of(row.metric))))
    head = ("", "value", "lower", "upper", "s.e.", "s.e., %")
    note = (
        "Lower and upper: 95 % confidence limits of the number itself; open: not known. Restricted "
        "mean: of the interval cut at the first censoring; section mean: over realisations and sets."
    )
    yield Table("Monte Carlo error of every number", head, tuple(rows), 1, note, small=True)


def _with_limits(estimate: Estimate, unknown: str) -> tuple[str, ...]:
    """Value, limits, standard error and its share in per cent, all to the digits of the error."""
    places, share = estimate.places(), estimate.relative_error
    limits = (number(v, places, "open") for v in (estimate.lower, estimate.upper))
    error = estimate.standard_error
    if error is not None and places is None:  # rounding noise
        error, share = 0.0, 0.0
    return (
        number(estimate.value, places, unknown),
        *limits,
        number(error, places, "unknown"),
        number(None if share is None else 100.0 * share, 1, ""),
    )


def censoring_blocks(material: Material) -> Iterator[Block]:
    """What became of every realisation."""
    table = material.results.realisations
    alike: dict[tuple[str, ...], list[str]] = {}
    for variant in material.study.variant_names:
        for scenario in material.study.scenario_names:
            tracks = material.results.part("realisations", variant, scenario)
            counts = tracks["status"].value_counts()
            cells = (str(int(counts.get(s, 0))) for s in ("reached", "censored", "failed"))
            alike.setdefault((variant, str(len(tracks)), *cells), []).append(scenario)
    rows = [(key[0], ", ".join(names), *key[1:]) for key, names in alike.items()]
    head = ("variant", "scenarios", "of each", "reached", "censored", "failed")
    horizon = material.study.limit.horizon_years
    note = (
        f"Censored: the horizon of {horizon:g} years came before the limit. A censored realisation stays "
        "in every quantile as longer than the horizon; an effect with a censored member is unknown, "
        "and a quantile that depends on it is not stated."
    )
    yield Table("What became of the realisations", head, tuple(rows), 2, note, small=True)
    reasons = table.loc[table["status"] == "failed", "failure"].value_counts()
    if len(reasons):
        told = tuple(f"{n} × {cut(str(reason), 200)}" for reason, n in reasons.items())
        yield Bullets(told, "Failures")


def calibration_blocks(material: Material) -> Iterator[Block]:
    """The fitted factor and its origin, and the results without it."""
    study, note = material.study, material.study.calibration
    if note is None:
        yield Text("The study records no calibration.")
    else:
        origin = f" with {cut(note.study, 120)}" if note.study else ""
        n = f", {note.realisations} realisations" if note.realisations else ""
        yield Text(
            f"A settlement factor of {note.factor:g} was fitted{origin} to one number: a median "
            f"interval of {note.target_days:g} days in scenario {note.scenario}"
            f"{f' of variant {note.variant}' if note.variant else ''}{n}. {cut(note.note, 400)}"
        )
    yield Text(
        "The factor multiplies every settlement; it carries no physics. What was fitted is no "
        "prediction; everything else is one, given the factor."
    )
    rows = []
    for variant in study.variant_names:
        factor = study.settlement_settings(variant).settlement_factor
        for scenario in study.scenario_names:
            row = material.row(scenario, INTERVAL, variant)
            if row is not None:
                growth = material.row(scenario, "sd_growth_1y_mm", variant)
                shown = "" if growth is None else level(growth, 0.5)
                fitted = note is not None and (note.scenario, note.factor) == (scenario, factor)
                cells = (level(row, 0.5), band(row), shown, "fitted" if fitted else "")
                rows.append((variant, f"{factor:g}", scenario, *cells))
    head = (
        "variant",
        "factor",
        "scenario",
        "P50, days",
        "P5 to P95",
        "SD growth in a year, mm",
        "",
    )
    yield Table("Intervals with and without a factor", head, tuple(rows), 3, small=True)
    if not any(study.settlement_settings(v).settlement_factor == 1.0 for v in study.variant_names):
        yield Text(
            "No variant of this study has a factor of 1: the uncalibrated result is not known here. "
            "Add a variant with settlement_factor = 1.",
            "warning",
        )
