"""Step A: 2.5D finite elements for a ballasted track on layered ground.

Enter by ``section_response(track)``. Read ``element`` (2.5D forms) and ``pml`` (absorbing border), then
``section`` and ``track_section`` (mesh and materials), ``solve`` (one wavenumber and frequency),
``reduced_basis`` (all of them) and ``moving_load`` (what Step B needs).
``equivalent_linear_response(track, train, speed)`` softens the ground first (``softening``).
"""

from mcsettle.step_a.fem25d.equivalent_linear import (
    equivalent_linear_response as equivalent_linear_response,
)
from mcsettle.step_a.fem25d.moving_load import SectionResponse as SectionResponse
from mcsettle.step_a.fem25d.section import MeshSettings as MeshSettings
from mcsettle.step_a.fem25d.section_response import section_response as section_response
from mcsettle.step_a.fem25d.settings import Settings as Settings
from mcsettle.step_a.fem25d.softening import SofteningHistory as SofteningHistory
