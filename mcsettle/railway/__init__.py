"""What is described: track and ground, vehicles and traffic, the irregularity of the rail. Frozen, SI.

``track``, ``vehicle`` and ``traffic`` hold the paper's tables as instances; ``spectra`` and
``irregularity`` sample random profiles; ``read_record``, ``record`` and ``record_sections`` read
measured ones, ``measured_profiles`` draws profiles around them.

Read ``track``, ``vehicle``, ``traffic``, then ``irregularity``.

May import: storage, errors, units, types.
"""
