"""The tables of a study file, a module for each subject: keys, units, defaults, limits of single values.

One frozen model a table. What a table means for the model (presets filled in, objects built) is
``study.build``; what several tables must satisfy together is ``study.checks``.

Read ``base``, then ``track``. ``study.Study`` has them all.

May import: railway, errors, units, types.
"""
