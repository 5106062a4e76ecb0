"""The command line of mcsettle: parse, call, print.

One BLAS thread unless the user says otherwise: the work is parallel elsewhere, waiting threads only get
in the way, and sums must not depend on them. It is set here because BLAS reads it when NumPy is imported.

Depends on: nothing; ``mcsettle.cli.app`` holds the commands.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
