"""Step A: 2.5D finite elements for a ballasted track on layered ground.

``section_response(track)`` is the door. Behind it: ``section`` (mesh and materials), ``element``
(2.5D forms), ``pml`` (absorbing border), ``solve`` (direct solution at one wavenumber and
frequency), ``reduced`` (reduced basis over all of them), ``response`` (what Step B sees).

Depends on: track, transfer, units.
"""

from mcsettle.fem25d.response import SectionResponse, rayleigh_speed
from mcsettle.fem25d.section import MeshSettings
from mcsettle.fem25d.settings import Settings
from mcsettle.fem25d.sweep import section_response

__all__ = ["MeshSettings", "SectionResponse", "Settings", "rayleigh_speed", "section_response"]
