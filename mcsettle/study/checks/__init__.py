"""What the tables of a study must satisfy together: names that meet, geometry, physics; by subject.

Each check is a generator of faults that reads ``Parts``: the tables that have no fault of their own
(the others are None or left out), so that one reading of a study reports all of its faults.

Read ``together``: it lists the checks.

May import: study.schema and study.build, railway, step_a, errors, units.
"""
