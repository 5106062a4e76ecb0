"""The numbers behind the pictures of a track: pure functions from Step A to small arrays.

``stress`` (against depth, along the track, Table 4), ``receptance`` (over wavenumber and
frequency), ``section`` (mesh and materials), ``vehicles`` (Fig. 4), ``passage`` (Figs. 5 and 6).
``mcsettle.figures`` draws what these return.

Depends on: nothing; see the modules.
"""
