"""Which transfer functions a settlement factor belongs to, and whether they are still the study's.

A factor is found for one track, ground, train and speed. ``transfer_identity`` is a digest of all that
the transfer functions of one scenario depend on; it needs no computation. A study may carry it beside
the factor (``factor_digest``), so that a factor from another ground does not pass unnoticed.
"""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from mcsettle.railway.scene import Scene
from mcsettle.railway.track import SectionTrack, without_laws
from mcsettle.step_a.transfers import section_settings
from mcsettle.study.build_forms import variability_table
from mcsettle.study.schema.run import SettlementTable
from mcsettle.study.study import Study

LENGTH = 16  # hex digits


def transfer_identity(scene: Scene, scenes: Sequence[Scene]) -> str:
    """Digest [16 hex digits] of what the transfer functions of ``scene`` depend on.

    ``scenes`` of the study: their fastest train decides the range of Step A on linear ground.
    """
    track, services = scene.track, []
    plain = without_laws(track)
    for service in scene.timetable.services:
        softened = scene.softened(service)
        soil = None if softened is None else asdict(softened.settings)
        services.append([service.train.description, float(service.speed), soil])
    description: dict[str, Any] = {
        "track": asdict(plain),
        "integration_depth": scene.integration_depth,
        "services": services,
        "wavenumbers": scene.wavenumbers.tolist(),
        "hertz_stiffness": scene.contact,
    }
    if scene.rail_loads.description:
        description["rail_loads"] = scene.rail_loads.description
    if isinstance(track, SectionTrack):
        from mcsettle.step_a.fem25d.cache import FORMAT
        from mcsettle.step_a.fem25d.settings import Settings

        by_service = [
            section_settings(scenes, scene.softened(service)) or Settings()
            for service in scene.timetable.services
        ]
        description["settings"] = [settings.description for settings in by_service]
        description["format"] = FORMAT
    text = json.dumps(description, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:LENGTH]


def factor_warnings(study: Study) -> list[str]:
    """A remark on every variant whose factor was found for something else than the variant.

    For other transfer functions than its own, or, where it has the study's, for another model form.
    """
    remarks, scenes, calibration = [], study.scenes, study.calibration
    scenario, days = study.reference_scenario, "DAYS"
    if calibration is not None:
        days = f"{calibration.target_days:g}"
        if calibration.scenario in study.scenario_names:
            scenario = calibration.scenario
    for variant in study.variants:
        if variant.factor_digest is None:
            continue
        again = (
            f"find it again with 'mcsettle calibrate STUDY --scenario {scenario} --variant "
            f"{variant.name} --median-days {days}'"
        )
        own_settings = study.settlement_settings(variant.name)
        fields = study.spatial_variability
        varies = variability_table(fields, variant) != fields
        other = _read_otherwise(own_settings, study.settlement, varies)
        if other:
            remarks.append(
                f"variant '{variant.name}': settlement_factor is the study's, calibrated for another "
                f"model form ({', '.join(other)} is read otherwise); {again}"
            )
        identities = {
            scene.scenario: transfer_identity(scene, scenes)
            for scene in scenes
            if scene.variant == variant.name
        }
        if variant.factor_digest not in identities.values():
            remarks.append(
                f"variant '{variant.name}': settlement_factor was found for the transfer functions "
                f"{variant.factor_digest}, those of scenario '{scenario}' are {identities[scenario]}: "
                f"another track, ground, train or speed; {again}"
            )
    return remarks


def _read_otherwise(settings: SettlementTable, study: SettlementTable, varies: bool) -> list[str]:
    """Keys that ``settings`` of a variant read otherwise than the ``study``, whose factor they have.

    ``varies``: whether the support does so otherwise.
    """
    of_variant = settings.model_dump(exclude={"factor_digest"})
    other = [key for key, value in of_variant.items() if value != getattr(study, key)]
    if "settlement_factor" in other:
        return []
    keys = [key for key in other if key != "integration_depth_m"]
    return [*keys, "spatial_variability"] if varies else keys
