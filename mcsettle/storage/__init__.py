"""How everything lies on disk: whole or not at all, in a folder or an object store, checked when read.

``files`` and ``location`` write and read; ``tables`` says which columns there are and in which unit;
``store`` writes them as Parquet shards; ``shard_record``, ``manifest`` and ``provenance`` say what is
complete and whose it is; ``lock`` keeps two runs apart.

Read ``location`` first, then ``store``.

May import: errors, units, types.
"""
