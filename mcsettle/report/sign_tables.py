"""Why an effect has its sign, as a table."""

from collections.abc import Iterator

from mcsettle.report.material import Material
from mcsettle.report.page import Block, Table
from mcsettle.report.words import cut
from mcsettle.summary.sign_split import SHORTENS, SIGNS, sign_rows


def sign_blocks(material: Material) -> Iterator[Block]:
    """What added services roughen and harden, in every variant; nothing without added services."""
    by_key = {(row.variant, row.name, row.metric): row for row in sign_rows(material.results)}
    rows = []
    for variant, scenario in dict.fromkeys(key[:2] for key in by_key):
        cells = [by_key[variant, scenario, metric].at(0.5).with_error() for metric, _, _ in SIGNS]
        share = by_key[variant, scenario, SHORTENS].statistics[0].estimate
        ends = [f"{100.0 * (end or 0.0):.0f}" for end in (share.lower, share.upper)]
        rows.append((cut(scenario, 40), variant, *cells, " to ".join(dict.fromkeys(ends))))
    if not rows:
        return
    head = (
        "scenario", "variant", "reduction, %", "by roughening alone, %", "by hardening alone, %",
        "ξ", "ξ*", "leverage", "pairs that shorten, %",
    )  # fmt: skip
    n = next(iter(by_key.values())).at(0.5).n
    note = (
        "An added service shortens the interval by what its axles roughen and lengthens it by the "
        "cycles with which it hardens the track for the others: it shortens where an added axle "
        "roughens more than ξ* of a baseline axle (ξ > ξ*), and any change of the rate counts "
        f"'leverage' times in days. Medians over the first {n} realisations, each part run by itself."
    )
    yield Table("Why an effect has its sign", head, tuple(rows), 2, note, small=True)
