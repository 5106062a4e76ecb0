"""Numbers from samples, each with its error: quantiles of censored days, lines, sensitivity, weights.

Statistics alone: nothing here knows what a study is.

``estimate`` says what an estimate is; ``sample`` has those of one sample, ``crossed`` those of
parameter sets × realisations, ``line_mean`` those of a line of sections. ``likelihood`` weighs
parameter sets by observations, ``conditioning`` says what that makes of the numbers.

Read ``estimate`` first, then ``sample``.

May import: economics, railway, storage, errors, units, types.
"""
