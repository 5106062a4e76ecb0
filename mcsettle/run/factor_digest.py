"""Which transfer functions a settlement factor belongs to, and whether they are still the study's.

A factor is found for one track, ground, train and speed. ``transfer_identity`` is a digest of all that
the transfer functions of one scenario depend on; it needs no computation. A study may carry it beside
the factor (``factor_digest``), so that a factor from another ground does not pass unnoticed.
"""

import hashlib
import json
from dataclasses import asdict, replace
from typing import Any

from mcsettle.railway.track import SectionTrack
from mcsettle.run.transfers import section_settings, softened_by
from mcsettle.study.study import Study, study_wavenumbers

LENGTH = 16  # hex digits


def transfer_identity(study: Study, variant: str, scenario: str) -> str:
    """Digest [16 hex digits] of what the transfer functions of one scenario and variant depend on."""
    track = study.track(variant)
    plain = replace(track, layers=tuple(replace(layer, law=None) for layer in track.layers))
    services = []
    for service in study.timetable(scenario).services:
        softened = softened_by(study, variant, service)
        soil = None if softened is None else asdict(softened.settings)
        services.append([asdict(service.train), float(service.speed), soil])
    description: dict[str, Any] = {
        "track": asdict(plain),
        "integration_depth": study.settlement_settings(variant).integration_depth_m,
        "services": services,
        "wavenumbers": study_wavenumbers(study).tolist(),
        "hertz_stiffness": study.track_table.hertz_stiffness_n_per_m,
    }
    if isinstance(track, SectionTrack):
        from mcsettle.step_a.fem25d.cache import FORMAT
        from mcsettle.step_a.fem25d.settings import Settings

        by_service = [
            section_settings(study, softened_by(study, variant, service)) or Settings()
            for service in study.timetable(scenario).services
        ]
        description["settings"] = [settings.description for settings in by_service]
        description["format"] = FORMAT
    text = json.dumps(description, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:LENGTH]


def factor_warnings(study: Study) -> list[str]:
    """A remark on every variant whose factor was found for other transfer functions than its own."""
    remarks = []
    for variant in study.variants:
        if variant.factor_digest is None:
            continue
        own = {name: transfer_identity(study, variant.name, name) for name in study.scenario_names}
        if variant.factor_digest not in own.values():
            scenario = _scenario(study)
            remarks.append(
                f"variant '{variant.name}': settlement_factor was found for the transfer functions "
                f"{variant.factor_digest}, those of scenario '{scenario}' are {own[scenario]}: "
                "another track, ground, train or speed; find it again with 'mcsettle calibrate "
                f"STUDY --scenario {scenario} --variant {variant.name} {_target(study)}'"
            )
    return remarks


def _scenario(study: Study) -> str:
    """The scenario a factor of this study is found in."""
    found = None if study.calibration is None else study.calibration.scenario
    if found in study.scenario_names and found is not None:
        return found
    return study.scenario_names[0] if study.economics is None else study.economics.baseline


def _target(study: Study) -> str:
    days = "DAYS" if study.calibration is None else f"{study.calibration.target_days:g}"
    return f"--median-days {days}"
