"""The report of a finished run: one description of a page, written as HTML or Markdown.

``material`` gathers what a folder holds, ``page`` says what a page consists of, ``build`` puts the
page together from one module a part, ``render`` writes it. No number is computed here twice: they
come from ``summary`` and the modules below it.

Read first: ``material``, then ``page``. Pictures are drawn in ``figures/``.

Depends on: nothing; see the modules.
"""
