"""Running a study: Step A, Step B shard by shard, the tables; in one process or in many.

``pipeline.run_study`` is the door: ``transfers`` does Step A, ``compute`` the shards, ``close`` the
tables. ``shards`` says what a shard is, ``status`` which are complete, ``stopping`` when the numbers
are precise enough; ``distributed`` and ``worker`` share a run between processes.

Read ``pipeline`` first, then ``compute``.

May import: every room before it (see ``tests/test_layers.py``); not analysis, report or cli.
"""
