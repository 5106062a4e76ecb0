"""Table of what added services roughen and harden."""

from typing import TYPE_CHECKING

from mcsettle.cli.tables import UNKNOWN, add_numbers, console, print_fitted, table
from mcsettle.summary.sign_split import SHORTENS, SIGNS

if TYPE_CHECKING:
    from mcsettle.estimate.estimate import Estimate
    from mcsettle.summary.summary import SummaryRow


def print_signs(rows: "list[SummaryRow]") -> None:
    """What added services do in one variant: medians with their errors, and the share of pairs."""
    if not rows:
        return
    out = console()
    signs = table("Why the effect has its sign: reduction of the interval [%], medians", "scenario")
    add_numbers(signs, "both", "by roughening", "by hardening", "ξ", "ξ*", "leverage", "P(shorter)")
    for scenario in dict.fromkeys(row.name for row in rows):
        of_scenario = {row.metric: row for row in rows if row.name == scenario}
        cells = [of_scenario[metric].at(0.5).with_error(UNKNOWN) for metric, _, _ in SIGNS]
        share = of_scenario[SHORTENS].statistics[0].estimate
        signs.add_row(scenario, *cells, share_words(share))
    print_fitted(out, signs, ("leverage",))
    out.print(
        f"By roughening: added axles settle but are not counted; by hardening: counted but do not "
        f"settle ({rows[0].at(0.5).n} realisations each). ξ: what an added axle roughens "
        "relative to one of "
        "the baseline; below ξ* the interval lengthens. Leverage: of a change of the rate on the "
        "interval. P(shorter): share of all pairs."
    )


def share_words(share: "Estimate") -> str:
    """A share in per cent, or its least and largest."""
    if share.lower is None or share.upper is None:
        return UNKNOWN
    low, high = (f"{100.0 * end:.0f}" for end in (share.lower, share.upper))
    return f"{low} %" if low == high else f"{low} to {high} %"
