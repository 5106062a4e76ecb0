"""The page of a report, put together: answer first, audit last."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from mcsettle.report.audit import limit_blocks, method_blocks, provenance_blocks
from mcsettle.report.first_page import first_page
from mcsettle.report.form_tables import form_blocks
from mcsettle.report.material import Material, StepAPart, read_material
from mcsettle.report.page import Block, Page, Picture, Section, Text
from mcsettle.report.pictures import (
    PAPER,
    growth_pictures,
    map_pictures,
    paper_figure,
    single_track_pictures,
    step_a_pictures,
)
from mcsettle.report.price_words import question, scope
from mcsettle.report.published import published_blocks
from mcsettle.report.quality import (
    calibration_blocks,
    censoring_blocks,
    convergence_blocks,
    sensitivity_blocks,
)
from mcsettle.report.register import register_table
from mcsettle.report.result_tables import charge_blocks, result_blocks
from mcsettle.report.scenarios import scenario_blocks
from mcsettle.report.sign_tables import sign_blocks
from mcsettle.report.words import cut
from mcsettle.types import Progress, silent

if TYPE_CHECKING:
    from mcsettle.analysis.tornado import Bar


def read_report(
    folder: Path,
    variant: str | None = None,
    miles: bool = False,
    with_track: bool = False,
    with_tornado: bool = False,
    progress: Progress = silent,
    processes: int = 1,
) -> Page:
    """The page of the run in ``folder``.

    Parameters
    ----------
    folder : results of ``mcsettle run``
    variant : the answer's variant (None: the first)
    miles : costs per mile
    with_track : with the pictures of track, trains and single realisations, from the cache or computed
    with_tornado : with one input at a time, computed
    progress, processes : as for ``run_study``

    Raises
    ------
    InputError
        No finished run there, or no such variant.
    """
    material = read_material(folder, variant, miles)
    if with_track:
        from mcsettle.analysis.track_case import table4, track_cases

        cases = track_cases(material.study, progress, processes)
        case = next((case for case in cases if case.variant == material.variant), cases[0])
        material = replace(material, step_a=StepAPart(case, tuple(table4(case, progress))))
    bars: Sequence[Bar] = ()
    if with_tornado and material.study.uncertain:
        from mcsettle.analysis.tornado import tornado

        bars = tornado(material.study, material.variant, progress=progress, processes=processes)
    return build(material, bars)


def build(material: Material, bars: "Sequence[Bar]" = ()) -> Page:
    """The page of ``material``; ``bars``: a tornado, if one was computed."""
    first = first_page(material)
    results = [*result_blocks(material), *sign_blocks(material), *growth_pictures(material)]
    track = list(_track(material))
    forms = [Section("forms", "Prices by model form", tuple(form_blocks(material)))]
    before = [
        *(forms if material.answers.summaries else []),
        Section("method", "Method", tuple(method_blocks(material))),
        Section("scenarios", "Scenarios", tuple(scenario_blocks(material))),
        Section("results", "Results", tuple(results)),
        Section("charges", "Charges", tuple(charge_blocks(material))),
        Section("track", "Track, trains and single realisations", tuple(track)),
    ]
    after = [
        Section("sensitivity", "Sensitivity", tuple(sensitivity_blocks(material, bars))),
        Section("convergence", "Convergence", tuple(convergence_blocks(material))),
        Section("censoring", "Censoring and failures", tuple(censoring_blocks(material))),
        Section("calibration", "Calibration", tuple(calibration_blocks(material))),
        Section("limits", "Limits and what is left out", tuple(limit_blocks(material))),
        Section("register", "Assumptions register", (register_table(material.study),)),
        Section("provenance", "Provenance", tuple(provenance_blocks(material))),
    ]
    title = cut(material.study.title, 300) or "Untitled study"
    page = Page(
        title,
        question(material.answers),
        scope(material.results, material.answers),
        first,
        tuple(before),
    )
    published: list[Section] = []
    if material.study.reference:
        blocks = tuple(published_blocks(material, page.pictures))
        published = [Section("published", "Published values beside ours", blocks)]
        before = [_with_paper(section, material) for section in before]
    held = material.provenance
    footer = f"mcsettle {held.package_version}, study {held.study_digest[:16]}"
    return replace(page, sections=(*before, *published, *after), footer=footer)


def _track(material: Material) -> list[Block]:
    if material.step_a is None:
        text = (
            "The pictures of the track, the trains and single realisations need Step A: 'mcsettle "
            "report DIR --track' draws them."
        )
        return [Text(text, "note")]
    single = single_track_pictures(material)
    return [*single, *map_pictures(material), *step_a_pictures(material)]


def _with_paper(section: Section, material: Material) -> Section:
    """Captions that name the paper's figure."""
    blocks = []
    for block in section.blocks:
        if isinstance(block, Picture) and block.name in PAPER:
            figure = paper_figure(material, block.name)
            block = replace(block, caption=f"{block.caption} Fig. {figure} of the paper.")
        blocks.append(block)
    return replace(section, blocks=tuple(blocks))
