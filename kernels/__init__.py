"""Taichi kernels of Step B; the only directory that imports Taichi.

Nothing but two environment variables is set here: Taichi reads them when it is imported, to keep its
banner off stdout and to leave the network alone.
"""

import os

os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")
os.environ.setdefault("TI_SKIP_VERSION_CHECK", "ON")
