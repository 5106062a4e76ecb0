"""The compiler of the kernels, imported here and nowhere else: Taichi, or Quadrants, its maintained fork.

``MCSETTLE_RUNTIME`` chooses; both compile the same sources. Their results agree to rounding, not bit for
bit, so that a results folder is of one of them. Every kernel takes ``ti`` from here.
"""

import atexit
import functools
import importlib
import importlib.util
import os
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, dataclass_transform

from mcsettle.errors import InputError

T = TypeVar("T")
VARIABLE = "MCSETTLE_RUNTIME"
RUNTIMES = ("taichi", "quadrants")
NAME = os.environ.get(VARIABLE) or RUNTIMES[0]

# Read at import: no banner on stdout, nothing asked of the network.
for _name in ("ENABLE_TAICHI_HEADER_PRINT", "ENABLE_QUADRANTS_HEADER_PRINT"):
    os.environ.setdefault(_name, "0")
os.environ.setdefault("TI_SKIP_VERSION_CHECK", "ON")
try:
    Path.home()
except RuntimeError:  # a container's user without a name: Taichi would end the process
    os.environ["HOME"] = tempfile.mkdtemp(prefix="mcsettle-home-")
    atexit.register(shutil.rmtree, os.environ["HOME"], ignore_errors=True)

if NAME not in RUNTIMES:
    raise InputError(f"{VARIABLE} is {NAME[:40]!r}; it takes {' or '.join(RUNTIMES)}")
try:
    ti: Any = importlib.import_module(NAME)
except ImportError:
    if NAME == RUNTIMES[0] or importlib.util.find_spec(NAME) is not None:
        raise
    raise InputError(
        f"{VARIABLE} is {NAME!r}, which is not installed: pip install 'mcsettle[{NAME}]'"
    ) from None

if NAME == "taichi":
    # Half of the time in which it builds kernels, the compiler looks for sources (of every function at
    # every call, of the class that a kernel might be in) and draws the line of every node, for messages
    # of faults that these kernels do not have.
    _functions = importlib.import_module("taichi.lang.kernel_impl")
    _nodes = importlib.import_module("taichi.lang.ast.ast_transformer_utils")

    def _position(context: Any, node: Any) -> str:
        return f"{context.file}:{node.lineno + context.lineno_offset}\n"

    _nodes.ASTTransformerContext.get_pos_info = _position
    _functions._inside_class = lambda *_, **__: False
    _functions.getsourcefile = functools.cache(_functions.getsourcefile)
    _functions.getsourcelines = functools.cache(_functions.getsourcelines)


@dataclass_transform(frozen_default=True)
def bundle(cls: type[T]) -> type[T]:
    """A frozen dataclass that kernels take as one argument; Quadrants takes others apart in a call."""
    cls = dataclass(frozen=True)(cls)
    del cls.__dataclass_fields__
    return cls
