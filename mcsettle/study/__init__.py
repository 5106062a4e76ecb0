"""The study file: its tables, its faults, and the objects of the model that it builds.

``study.load_study`` is the door: one TOML file becomes one frozen ``Study``. ``schema`` has the tables,
``read`` parses them, ``checks`` and ``faults`` say what is wrong, ``build`` makes the objects,
``parameter_sets`` draws the uncertain inputs. Nothing here knows how a study is run.

Read ``study`` first, then ``schema``.

May import: railway, economics, estimate, step_a, step_b, storage, errors, units, types.
"""
