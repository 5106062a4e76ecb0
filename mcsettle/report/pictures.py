"""Pictures beyond the results: growth and its rate, single tracks, and what Step A shows.

``PAPER`` says which figure of the paper each one stands for, and why the two differ.
"""

from collections.abc import Iterator

import numpy as np

from mcsettle.analysis.stress_under_train import stress_along
from mcsettle.analysis.track_case import layer_tops
from mcsettle.estimate.rounding import number
from mcsettle.report.curves import MOVING, growths, rates
from mcsettle.report.figures.maps import force_figure, stress_map_figure
from mcsettle.report.figures.results import rates_figure, spreads_figure
from mcsettle.report.figures.track_in_time import concept_figure, mixed_figure, profiles_figure
from mcsettle.report.material import Material
from mcsettle.report.page import Picture
from mcsettle.report.single_tracks import (
    TRACK,
    mixed_days,
    mixed_scenario,
    profiles_at_limit,
)
from mcsettle.report.track_pictures import track_figures
from mcsettle.report.words import cut
from mcsettle.step_a.transfers import step_a
from mcsettle.summary.results import INTERVAL
from mcsettle.units import KN, KPA, MM

GROWTH = "sd_growth_1y_mm"
# Figures of the paper by our picture: number and why ours differs.
PAPER = {
    "vehicle_models": ("4", "on the paper's simplified track; its profile is not published"),
    "freight_passage": ("5 and 6", "our profile, of the same class; settlement without any factor"),
    "section": ("7", "half of it is solved; the absorbing border lies beyond"),
    "concept": ("9", "drawn with the median intervals found here instead of symbols"),
    "slice": (
        "10",
        "one of our realisations; all cars alike, the paper's train is of another length",
    ),
    "profiles": ("11", "one of our realisations; the paper's profile is not published"),
    "sd_time": ("12 or 17", "medians and a band over many realisations instead of one"),
    "growth": ("13", "growth over the first 365 days, with its spread"),
    "rates": ("14", "our reading: change over a moving window; the paper does not define its own"),
    "stress_depth": ("15 and 16", "root mean square of the dynamic part over profile and axles"),
    "mixed": ("18", "two whole days of one realisation, updated after every axle passage"),
}
NOT_DRAWN = {
    "8": "needs the field record, which is not published; the validation study stands apart",
}
TITLES = {
    "section": "Cross-section of track and ground with its mesh",
    "softening": "Softened moduli under the first train",
    "receptance": "Rail receptance over wavenumber and frequency",
    "stress_depth": "Deviatoric stress against depth, quasi-static and dynamic",
    "stress_along": "Quasi-static deviatoric stress along the track at several depths",
    "slice": "Deflection of track and ground under the train",
    "table4": "Increase of the stress at the subgrade surface with speed",
    "vehicle_models": "Peak dynamic rail deflection by vehicle model",
    "freight_passage": "Stress and settlement along the track as one freight axle passes",
}
OF_THE_PAPER = ("vehicle_models", "freight_passage")  # of its own trains, whatever the study's are
PAGE_WIDTH = 9.2  # inches of the widest picture
MOST_TRAINS = 3  # in the map of forces
LEAST = 80  # px an inch of a wide picture, below which it scrolls


def paper_figure(material: Material, name: str) -> str:
    """Number of the paper's figure that the picture ``name`` stands for."""
    if name == "sd_time":
        return "12" if material.has_speed_effect else "17"
    return PAPER[name][0]


def growth_pictures(material: Material) -> Iterator[Picture]:
    """SD growth in a year, the rate of change in time, the tamping concept."""
    values = growths(material, GROWTH)
    if any(v.quantiles is not None for v in values):
        figure = spreads_figure(values, "SD growth in the first 365 days [mm]")
        alt = "SD growth in a year by scenario: " + "; ".join(
            f"{cut(v.label, 40)}: median {number(v.quantiles[2])} mm"
            for v in values
            if v.quantiles is not None
        )
        text = (
            "Growth of the SD in the first year: P5 to P95, middle half, median; an arrow where "
            "sections tamped before have grown more than is known."
        )
        yield Picture("growth", figure, alt + ".", text)
    curves = rates(material)
    if curves:
        alt = "Rate of change of the SD against days, by scenario: " + "; ".join(
            f"{cut(c.label, 40)} from {number(float(c.rate[1, 0]))} to "
            f"{number(float(c.rate[1, -1]))} mm/year"
            for c in curves
        )
        text = (
            f"Change of the SD over the last {MOVING:g} days, per year: medians; shaded, P5 to P95 "
            "of the first scenario. Until half of the realisations are tamped."
        )
        yield Picture("rates", rates_figure(curves, MOVING), alt + ".", text)
    yield from _concept(material)


def _concept(material: Material) -> Iterator[Picture]:
    sd = material.study.profile.sd_mm
    if sd is None or not material.compared:
        return
    scenario = material.compared[-1]
    effect = material.study.effects[scenario]
    rows = [material.row(name, INTERVAL) for name in (effect.baseline, effect.scenario)]
    medians = [row.at(0.5).value for row in rows if row is not None]
    if len(medians) < 2 or medians[0] is None or medians[1] is None:
        return
    base, other = medians[0], medians[1]
    limit = material.study.limit.sd_limit_mm
    figure = concept_figure(material.title(scenario), (base, base), (other, base), sd, limit)
    alt = (
        f"Two saw-tooth lines of SD against days: tamping first after {base:.0f} days in the "
        f"baseline and after {other:.0f} with the change; later intervals are equal."
    )
    text = (
        "How the cost is reckoned: the change acts until the first tamping, which comes earlier; "
        "all later intervals keep the baseline's length. Straight lines between median days."
    )
    yield Picture("concept", figure, alt, text)


def single_track_pictures(material: Material) -> Iterator[Picture]:
    """Profiles at the limit and a few days of mixed traffic, of one track computed again."""
    prepared = step_a(material.study.scenes)  # from the cache
    shown = profiles_at_limit(material, prepared)
    where = f"realisation {TRACK} of seed {material.study.seed}"
    if shown:
        alt = f"Profile of {where} before traffic and at the end: " + "; ".join(
            f"{cut(p.label, 40)}: {'not reached' if p.days is None else f'day {p.days:.0f}'}"
            for p in shown
        )
        text = f"One realisation ({where}) before traffic and at its limit, in the band of the SD."
        yield Picture("profiles", profiles_figure(shown), alt + ".", text)
    scenario = mixed_scenario(material)
    view = None if scenario is None else mixed_days(material, scenario, prepared)
    if view is not None and scenario is not None:
        rise = float(view.sd[-1] - view.sd[0])
        alt = (
            f"SD of one realisation from day {view.days[0]:g} to {view.days[-1]:g} of mixed traffic; it "
            f"rises by {number(rise)} mm."
        )
        text = (
            f"Two days of mixed traffic on one realisation ({where}), "
            f"{cut(material.title(scenario), 60)}: "
            "updated after every axle passage. Time is shared out by passages."
        )
        yield Picture("mixed", mixed_figure(view), alt, text)


def map_pictures(material: Material) -> Iterator[Picture]:
    """Dynamic force by axle and wavelength, and stress by place and depth."""
    part = material.step_a
    if part is None:
        return
    trains = {run.service.train.name: run for run in reversed(part.case.runs)}
    runs = list(reversed(trains.values()))[:MOST_TRAINS]
    wavelengths = 2.0 * np.pi / part.case.wavenumbers
    forces = [(run.label, run.transfer.force) for run in runs]
    largest = "; ".join(
        f"{run.label}, largest {number(float(np.abs(run.transfer.force).max()) * MM / KN)} kN per mm"
        for run in runs
    )
    text = "Dynamic wheel force for a profile of 1 mm amplitude, every axle of the train."
    yield Picture("force", force_figure(forces, wavelengths), f"{text} {largest}.", text)
    run = runs[0]
    grid, train = run.transfer.grid, run.service.train
    view = stress_along(run.response, train, run.service.speed, grid.z, np.eye(len(grid.z)))
    alt = (
        f"Map of the quasi-static deviatoric stress, largest {number(view.sigma.max() / KPA)} kPa."
    )
    text = f"Quasi-static deviatoric stress around the middle car: {run.label}. Lines: layers."
    figure = stress_map_figure(view, layer_tops(part.case.track))
    yield Picture("stress_map", figure, alt, text)


def step_a_pictures(material: Material) -> Iterator[Picture]:
    """Every picture of the track, sized for a page."""
    part = material.step_a
    if part is None:
        return
    for name, draw in track_figures(part.case, list(part.table4)).items():
        if name in OF_THE_PAPER and not material.study.reference:
            continue
        figure = draw()
        width, height = figure.get_size_inches()
        if width > PAGE_WIDTH:
            figure.set_size_inches(PAGE_WIDTH, height * min(1.0, (PAGE_WIDTH / width) ** 0.4))
        text = f"{TITLES.get(name, name.replace('_', ' '))}. Track of variant {part.case.variant}."
        yield Picture(name, figure, text, text, int(LEAST * figure.get_size_inches()[0]))
