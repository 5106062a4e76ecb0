"""Step A: 2.5D finite elements for a ballasted track on layered ground.

``section_response(track)`` is the door. Behind it: ``section`` (mesh and materials), ``element``
(2.5D forms), ``pml`` (absorbing border), ``solve`` (direct solution at one wavenumber and
frequency), ``reduced`` (reduced basis over all of them), ``moving`` (what Step B sees: moving loads).
``equivalent_linear_response(track, train, speed)`` softens the ground first (``softening``).

Depends on: curves, errors, soil, track, traffic, transfer, units.
"""

from mcsettle.step_a.fem25d.equivalent_linear import (
    equivalent_linear_response as equivalent_linear_response,
)
from mcsettle.step_a.fem25d.moving_load import SectionResponse as SectionResponse
from mcsettle.step_a.fem25d.section import MeshSettings as MeshSettings
from mcsettle.step_a.fem25d.section_response import section_response as section_response
from mcsettle.step_a.fem25d.settings import Settings as Settings
from mcsettle.step_a.fem25d.softening import SofteningHistory as SofteningHistory
