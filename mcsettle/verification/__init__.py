"""Step A against closed forms and exact layered ground; how far its choices still matter.

``closed_forms``, ``layered_ground`` and ``strip`` are solutions that do not come from the finite
elements; ``case`` says what one comparison is, ``run_cases`` is what ``mcsettle validate`` calls, and
``convergence`` repeats Step A with finer choices.

Read ``case`` first, then ``closed_form_cases``.

May import: step_a, railway, storage, errors, units, types.
"""
