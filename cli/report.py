"""``mcsettle report``, ``export`` and ``compare``: from the folder of a run to what people read."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcsettle.cli.options import Force, Json
from mcsettle.cli.terminal import (
    Progress,
    checked_file,
    checked_folder,
    cores,
    inform,
    plainly,
    refuse_url,
    say,
    warn,
)
from mcsettle.errors import InputError
from mcsettle.storage.files import is_url

if TYPE_CHECKING:
    from mcsettle.report.page import Page

Folder = Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a finished run.")]


@plainly
def report(
    folder: Folder,
    out: Annotated[
        Path | None, typer.Option(help="HTML file to write (default: DIR.html, beside DIR).")
    ] = None,
    variant: Annotated[
        str | None, typer.Option(help="Variant of the first page (default: the first).")
    ] = None,
    miles: Annotated[bool, typer.Option("--miles", help="Costs per mile.")] = False,
    track: Annotated[
        bool,
        typer.Option("--track", help="Also draw track, trains and single realisations (Step A)."),
    ] = False,
    tornado: Annotated[
        bool, typer.Option("--tornado", help="Also move each uncertain input by itself.")
    ] = False,
    figures: Annotated[
        Path | None, typer.Option(help="Also write every picture there (SVG, PNG, PDF).")
    ] = None,
    markdown: Annotated[
        Path | None, typer.Option(help="Also write texts and tables into this Markdown file.")
    ] = None,
    pdf: Annotated[
        bool, typer.Option("--pdf", help="Also print the page to PDF (extra 'pdf').")
    ] = False,
    force: Force = False,
) -> None:
    """Write the report of a run: one HTML file that needs nothing else."""
    from mcsettle.report.build import read_report
    from mcsettle.report.pdf import find_browser, print_pdf
    from mcsettle.report.render import html
    from mcsettle.report.render import markdown as as_markdown
    from mcsettle.storage.marks import refuse_others, write_marked
    from mcsettle.summary.results import folder_of_run, study_of

    target = checked_file(out or beside(folder, ".html"), (".html",))
    if markdown is not None:
        refuse_url(markdown, "--markdown")
    if figures is not None:
        checked_folder(figures, "--figures")
    study, printed = study_of(folder_of_run(folder)).identity, target.with_suffix(".pdf")
    targets = [target, *([markdown] if markdown else []), *([printed] if pdf else [])]
    refuse_others(targets, study, force)  # before anything takes its time
    if pdf:
        find_browser()
    page = read_report(folder, variant, miles, track, tornado, Progress(), cores())
    text = html(page)
    files = {target: text.encode("utf-8")}
    if markdown is not None:
        files[markdown] = as_markdown(page).encode("utf-8")
    if figures is not None:
        files |= picture_files(page, figures)
    if pdf:
        files[printed] = print_pdf(text)
    written = write_marked(files, study, force)
    for path in written[:4]:
        inform(f"Wrote {path}")
    if len(written) > 4:
        inform(f"and {len(written) - 4} more files")


@plainly
def export(
    folder: Folder,
    xlsx: Annotated[
        Path | None, typer.Option(help="Workbook to write (default: DIR.xlsx, beside DIR).")
    ] = None,
    csv: Annotated[
        Path | None, typer.Option(help="Folder for CSV files, written instead of a workbook.")
    ] = None,
    force: Force = False,
) -> None:
    """Write summary, effects, inputs and provenance for workbooks: XLSX, or CSV."""
    from mcsettle.report.export import write_csv, write_xlsx
    from mcsettle.report.material import read_material

    if csv is not None:
        checked_folder(csv, "--csv")
    if xlsx is not None or csv is None:
        xlsx = checked_file(xlsx or beside(folder, ".xlsx", "--xlsx"), (".xlsx",), "--xlsx")
    material = read_material(folder)
    if csv is not None:
        written = write_csv(material, csv, force)
        inform(f"Wrote {len(written)} files to {csv}")
    if xlsx is not None:
        for remark in write_xlsx(material, xlsx, force):
            warn(f"remark: {remark}")
        inform(f"Wrote {xlsx}")


@plainly
def compare(
    first: Annotated[Path, typer.Argument(metavar="DIR1", help="Folder of a finished run.")],
    second: Annotated[Path, typer.Argument(metavar="DIR2", help="Folder of another one.")],
    json_output: Json = False,
) -> None:
    """Set two runs, or two studies, side by side: paired on the tracks they share."""
    from mcsettle.cli.compare import comparison_json, print_comparison
    from mcsettle.summary.compare import compare as compared
    from mcsettle.summary.results import read_results

    comparison = compared(read_results(first), read_results(second))
    if json_output:
        say(comparison_json(comparison), True)
    else:
        print_comparison(comparison)


def picture_files(page: "Page", folder: Path) -> dict[Path, bytes]:
    """Every picture of a report, as files in ``folder``."""
    from mcsettle.report.figures.forms import forms_figure
    from mcsettle.report.figures.style import METADATA, files_of

    named = [(picture.figure, picture.name) for picture in page.pictures]
    if page.bars is not None:
        named.insert(0, (forms_figure(page.bars), "answer"))
    files: dict[Path, bytes] = {}
    for figure, name in named:
        files |= files_of(figure, folder, name, tuple(METADATA))
    return files


def beside(folder: Path, ending: str, option: str = "--out") -> Path:
    """A file beside the folder of a run: nothing is added to what the manifest lists.

    Raises
    ------
    InputError
        The run is in an object store.
    """
    if is_url(folder):
        raise InputError(
            f"the results are in a store, and nothing is written there; name a file of this machine "
            f"({option} FILE{ending})"
        )
    whole = folder.absolute()
    return whole.with_name(whole.name + ending)
