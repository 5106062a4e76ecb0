"""``mcsettle status`` and ``gather``: what a results folder holds, and closing a run made in parts."""

import json
from dataclasses import asdict
from typing import TYPE_CHECKING

from mcsettle.cli.options import Folder, Json, TakeOver
from mcsettle.cli.run import tell_failed
from mcsettle.cli.terminal import inform, plainly, say
from mcsettle.errors import InputError

if TYPE_CHECKING:
    from mcsettle.run.status import Survey

MOST_SHOWN = 10


@plainly
def status(folder: Folder, json_output: Json = False) -> None:
    """Say what a results folder holds: shards there, missing and damaged, and who is at work."""
    from mcsettle.run.status import survey
    from mcsettle.storage.location import place

    if not place(str(folder)).exists():
        raise InputError(f"{folder} is not a folder; 'mcsettle run STUDY --out {folder}' makes one")
    state = survey(str(folder))
    say(status_json(state) if json_output else "\n".join(status_lines(state)), json_output)


@plainly
def gather(folder: Folder, take_over: TakeOver = False) -> None:
    """Check that every shard of a run made in parts is there, and close it: effects, summary."""
    from mcsettle.run.close import gather as close

    finished = close(str(folder), take_over)
    inform(f"{finished.n_shards} shards are complete. Next: mcsettle summarise {finished.folder}")
    tell_failed(finished.n_failed)


def status_json(state: "Survey") -> str:
    """The survey as JSON."""
    data = {
        "folder": state.folder,
        "finished": state.finished,
        "remark": state.remark,
        "provenance": asdict(state.provenance),
        "realisations": state.realisations,
        "parameter_sets": state.parameter_sets,
        "shards": state.n_shards,
        "whole": state.n_whole,
        "failed_realisations": state.n_failed,
        "scenarios": [
            {"variant": variant, "scenario": scenario, "shards": n,
             "whole": state.whole[variant, scenario]}
            for (variant, scenario), n in state.shards.items()
        ],
        "faults": [asdict(fault) for fault in state.faults],
        "strays": list(state.strays),
        "at_work": [asdict(owner) for owner in state.owners],
    }  # fmt: skip
    return json.dumps(data, indent=2, ensure_ascii=False)


def status_lines(survey: "Survey") -> list[str]:
    """The survey as text."""
    state = "finished" if survey.finished else "not finished"
    sets = f" × {survey.parameter_sets} parameter sets" if survey.parameter_sets > 1 else ""
    lines = [
        f"{survey.folder}: {state}, {survey.n_whole} of {survey.n_shards} shards, "
        f"{survey.realisations} realisations{sets}, seed {survey.provenance.seed}, "
        f"mcsettle {survey.provenance.package_version}"
    ]
    for (variant, scenario), n in survey.shards.items():
        lines.append(f"  {variant} {scenario}: {survey.whole[variant, scenario]} of {n}")
    lines += [f"  {f.state}: {f.shard} ({f.reason})" for f in survey.faults[:MOST_SHOWN]]
    if len(survey.faults) > MOST_SHOWN:
        lines.append(f"  … and {len(survey.faults) - MOST_SHOWN} more")
    lines += [f"  stray: {name}" for name in survey.strays[:MOST_SHOWN]]
    lines += [f"  at work: {owner}" for owner in survey.owners]
    if survey.n_failed:
        lines.append(f"  {survey.n_failed} realisations failed; their rows say why")
    return [*lines, *_next(survey)]


def _next(survey: "Survey") -> list[str]:
    """What to do."""
    if survey.finished:
        return [f"Next: mcsettle summarise {survey.folder}"]
    if survey.owners:
        return ["Next: wait for those at work"]
    if survey.n_whole < survey.n_shards:
        return [f"Next: mcsettle run STUDY --out {survey.folder} computes what is missing"]
    return [f"{survey.remark}. Next: mcsettle gather {survey.folder}"]
