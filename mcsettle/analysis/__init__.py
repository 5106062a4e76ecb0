"""What else is asked of a study: calibration, posterior, forecast, tornado, life, its track in numbers.

No results folder is written here. ``calibration`` fits the settlement factor to one number,
``posterior`` to a section's history; ``forecast`` says when a section reaches the limit, ``life`` what
many tampings cost, ``tornado`` which input matters most.

Read any: each module answers one question.

May import: run, summary, study, step_b, step_a, estimate, railway, storage, errors, units, types.
"""
