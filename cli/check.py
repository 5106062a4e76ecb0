"""``mcsettle check``: a study without running it, and remarks on one that will run."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from mcsettle.cli.options import StudyFile
from mcsettle.cli.study_file import study_in
from mcsettle.cli.terminal import as_options, plainly, say, warn

if TYPE_CHECKING:
    from mcsettle.study.study import Study


@plainly
def check(
    study: StudyFile,
    resolved: Annotated[
        bool, typer.Option("--resolved", help="Print the study with every default filled in.")
    ] = False,
) -> None:
    """Validate a study without running it: all faults at once."""
    from mcsettle.study.study import resolved_toml

    loaded = study_in(study)
    for variant in loaded.variant_names:  # refused where a record has too few sections
        loaded.initial_profiles(variant).sample(range(loaded.run.realisations)[-1:])
    warn_of(loaded)
    text = resolved_toml(loaded) if resolved else "\n".join(study_lines(loaded))
    say(text, resolved, nl=not resolved)


def warn_of(study: "Study") -> None:
    """Print what is worth a second look in a valid study."""
    from mcsettle.run.factor_digest import factor_warnings

    for warning in (*study.warnings, *factor_warnings(study)):
        warn(as_options(f"warning: {warning}"))


def study_lines(study: "Study") -> Iterator[str]:
    """A sound study in a few lines."""
    from mcsettle.report.assumptions import stress_remarks

    yield f"{study.title or 'untitled'}: sound"
    yield f"digest {study.digest}"
    yield (
        f"track {study.track_table.preset_name}, {study.run.realisations} realisations, "
        f"limit {study.limit.sd_limit_mm:g} mm"
    )
    yield from stress_remarks(study)
    for scenario in study.scenarios:
        services = ", ".join(
            f"{s.per_day} × {s.train} at {s.speed_kmh:g} km/h" for s in scenario.timetable
        )
        tonnage = study.mgt_per_day(scenario.name)
        yield f"scenario {scenario.name}: {services}; {tonnage:.6g} MGT/day"
    for name in study.variant_names:
        settings = study.settlement_settings(name)
        yield (
            f"variant {name}: {settings.stress} stress, {settings.cycles} cycles, "
            f"settlement factor {settings.settlement_factor:g}"
        )
