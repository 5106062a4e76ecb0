"""Method, limits, and what an audit needs: versions, digests, the study, the command that repeats it."""

import sys
from collections.abc import Iterator
from importlib.metadata import version

from mcsettle.report.material import Material, rows_digest
from mcsettle.report.page import Block, Bullets, Code, Table, Text
from mcsettle.report.words import cut
from mcsettle.study.schema.profile import ProfileTable, RecordTable
from mcsettle.study.study import resolved_toml

LIBRARIES = ("numpy", "scipy", "pandas", "pyarrow", "matplotlib", "jinja2", "pydantic")


def method_blocks(material: Material) -> Iterator[Block]:
    """The model on a page, with this study's choices."""
    study = material.study
    table = study.track_table
    kind = (
        "a 2.5D finite-element cross-section with an absorbing border"
        if table.model == "section"
        else "a beam on an elastic layer, in closed form"
    )
    soil = (
        "The soil is linear."
        if study.softening(material.variant) is None
        else "The soil is equivalent-linear: moduli fit the strains of each train at its speed."
    )
    yield Text(
        "mcsettle implements the engineering-economic model of Charoenwong, Connolly, Odolinski, "
        "Alves Costa, Galvín and Smith, The effect of rolling stock characteristics on differential "
        "railway track settlement, as a Monte Carlo simulation."
    )
    yield Text(
        f"Step A, once for every train and speed: the response of track and ground to a moving, "
        f"oscillating load, from {kind} (track {table.preset_name}). {soil} Whole trains, with car "
        "bodies, bogies and wheelsets, are coupled through the track, Eq. (3)."
    )
    name = study.variant(material.variant).spectrum or study.profile.spectrum
    spectrum = name.replace("_", " ").replace("fra", "FRA")
    spectrum = spectrum.replace("german", "German")
    profile = f"a Gaussian profile of the {spectrum} spectrum"
    if study.profile.file is not None:
        profile = _measured(study.profile)
    yield Text(
        f"Step B, for every realisation: {profile}, wavelengths of {study.profile.shortest_m:g} to "
        f"{study.profile.longest_m:g} m on a window "
        f"of {study.profile.window_m:g} m. Each axle passage gives dynamic forces from the profile "
        "as it is now, deviatoric stresses (Eq. 10), permanent strains (Eqs. 1 and 2), a settlement "
        "that adds to the profile. The track is tamped when the standard deviation (SD) of the "
        f"profile reaches {study.limit.sd_limit_mm:g} mm; one that has not within "
        f"{study.limit.horizon_years:g} years is censored. Time stepping: "
        f"{study.run.stepping.replace('_', ' ')}."
    )
    if study.economics is not None:
        yield Text(
            "Economics, realisation by realisation: every scenario against the baseline on "
            "the same realisation. "
            "Elasticity γ: relative change of the interval over relative change of speed or "
            "tonnage. Marginal cost, Eqs. (8) and (9): −γ c r / (exp(r T) − 1) / d, with c the cost "
            "of tamping a track-km, r the discount rate, T the baseline's interval in years, d the "
            "new yearly tonnage, or the new speed times the trains a year. It is the derivative of "
            "the present value with respect to the first interval; later ones are held."
        )
    yield Text(
        "A realisation is addressed by (seed, index): the same index is the same initial profile in "
        "every scenario, so differences between scenarios are differences on the same profile."
    )


def _measured(profile: ProfileTable) -> str:
    """Where the tracks come from in a study of a measured record, in words."""
    record = profile.record or RecordTable()
    kinds = {
        "section": "a section of the measured record",
        "sections": "the sections of the measured record in turn",
        "phases": "a profile with the measured section's spectrum and random phases",
    }
    return f"{kinds[record.ensemble]} {cut(profile.file or '', 80)}"


def limit_blocks(material: Material) -> Iterator[Block]:
    """What the model leaves out."""
    yield Bullets(
        (
            "Vertical settlement of ballasted plain line only: no wear, rolling contact fatigue, "
            "switches, bridges, transition zones, drainage, frost or lateral geometry.",
            "The cost is tamping alone, direct and short-run; other damage that the same train does "
            "is not in it.",
            "The track is uniform along its length: no soft spots, no hanging sleepers. Uneven "
            "settlement grows from the profile's own dynamic forces.",
            "Linear dynamics: no loss of contact, no friction in suspensions. Vehicles with little "
            "damping are delicate: window length, car length and the counting of load cycles move "
            "their effect, even its sign.",
            "The settlement laws are fits to laboratory tests, used far beyond their number of cycles.",
            "Tamping restores the initial SD; its own damage and imperfect recovery are left out, "
            "and later intervals do not shorten.",
            "Axle loads, speeds and vehicles are those of the timetable, every day, unless they are "
            "among the uncertain inputs.",
        )
    )
    warnings = tuple(cut(w, 400) for w in material.study.warnings)
    if warnings:
        yield Bullets(warnings, "Remarks on this study")


def provenance_blocks(material: Material) -> Iterator[Block]:
    """Digests, versions, the commands that repeat it, and the study itself."""
    held, study = material.provenance, material.study
    options = f"--realisations {material.n_tracks} --seed {study.seed}"
    if study.uncertain:
        options += f" --parameter-sets {material.n_sets}"
    if study.run.stepping == "every_axle":
        options += " --exact"
    options_of_report = "" if material.variant == study.variant_names[0] else (
        f" --variant {material.variant}"
    )  # fmt: skip
    options_of_report += " --miles" if material.miles else ""
    options_of_report += "" if material.step_a is None else " --track"
    yield Code(
        "# the study at the end of this page, saved as study.toml\n"
        f"mcsettle run study.toml --out DIR {options}\n"
        f"mcsettle report DIR{options_of_report}",
        "The commands that repeat this report",
    )
    rows = [
        ("mcsettle, the run", held.package_version),
        ("study digest", held.study_digest),
        ("transfer functions digest (Step A)", held.transfer_digest),
        ("seed of the realisations", str(held.seed)),
        ("realisations", str(material.n_tracks)),
        ("parameter sets", str(material.n_sets)),
        ("compiler of the kernels", f"{held.runtime} {held.taichi_version}"),
        ("precision", held.precision),
        ("lanes of the kernels", str(held.lanes)),
    ]
    tables = material.results
    for name in ("realisations", "history", "effects"):
        frame = getattr(tables, name)
        rows.append((f"rows of {name}", str(len(frame))))
        rows.append((f"digest of the rows of {name}", rows_digest(frame)))
    yield Table("The run", ("what", "value"), tuple(rows), 2, small=True)
    python = ".".join(str(part) for part in sys.version_info[:3])
    libraries = [("mcsettle, this page", version("mcsettle")), ("Python", python)]
    libraries += [(name, version(name)) for name in LIBRARIES]
    yield Table(
        "Versions that made this page", ("library", "version"), tuple(libraries), 2, small=True
    )
    yield Code(resolved_toml(study), "The study with every default filled in", folded=True)
