"""From the tables of a finished run to the numbers that answer the study's question.

``results`` reads a folder back; ``summary`` has days, effects and costs of every scenario, ``spread``
where their spread comes from, ``segments`` the results by segment of a line, ``compare`` two folders
side by side.

Read ``results`` first, then ``summary``.

May import: study, estimate, economics, storage, errors, units, types.
"""
