"""Pictures of a track: each function takes numbers, or a view of its module, and gives a Figure.

``style`` is the one place for colours, fonts and the writing of files. Only these modules import
matplotlib.

Depends on: nothing; see the modules.
"""
