"""Step A: what a moving, oscillating load does to track and ground, once per train and speed.

Two track models, ``fem25d`` (finite elements) and ``beam`` (closed form), answer behind one interface
(``transfer.TrackResponse``); ``interaction`` couples a train to it, Eq. (3) and Appendix A, and gives
the ``TransferFunctions``: all that Step B knows of Step A.

Read ``transfer``, then ``interaction``, then the door of ``fem25d``.

May import: railway, storage, errors, units, types.
"""
