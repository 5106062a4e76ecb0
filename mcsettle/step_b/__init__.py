"""Step B: traffic settles a random profile until its standard deviation reaches the limit.

``passage`` is the definition: one axle, one realisation, plain NumPy. ``engine`` does the same for
thousands of realisations: ``cycle_jump`` over months at a time, ``stepwise`` passage by passage; the
right-hand side is ``spectral`` (second-order form) or ``pointwise`` (every x and depth).

Read ``passage`` first, then ``case`` and ``engine``.

May import: step_a, railway, storage, kernels, errors, units, types.
"""
