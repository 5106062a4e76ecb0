"""Start Taichi once, quietly, in double precision, with every option stated.

The compiler gives a parallel loop at least 512 iterations per thread by default, so that a loop over a
few tiles would run on one core; the three ``cpu`` options below switch that rule off.
"""

import contextlib
import hashlib
import io
import os
import tempfile
from pathlib import Path

from mcsettle.errors import InputError
from mcsettle.kernels.backend import NAME, ti
from mcsettle.step_a.processes import cores
from mcsettle.storage.files import cache_folder, refuse_link

STALE_LOCK = 60.0  # s

_started: dict[str, object] = {}


def start(threads: int | None = None, debug: bool = False) -> dict[str, object]:
    """Initialise Taichi for the CPU; idempotent, refuses a different second configuration.

    Parameters
    ----------
    threads : worker threads, or None for all cores this process may use
    debug : check array bounds inside kernels (slow; for tests)

    Returns
    -------
    The effective configuration, for the run log.

    Raises
    ------
    RuntimeError : Taichi already runs with another configuration.
    """
    n_threads = threads or cores()
    wanted: dict[str, object] = {"threads": n_threads, "debug": debug, "version": version()}
    if _started:
        if threads is not None and _started["threads"] != n_threads:
            raise RuntimeError(f"Taichi runs with {_started}; start a new process for {wanted}")
        return dict(_started)
    with contextlib.redirect_stdout(io.StringIO()):
        ti.init(
            arch=ti.cpu,
            default_fp=ti.f64,
            default_ip=ti.i32,
            cpu_max_num_threads=n_threads,
            fast_math=False,
            debug=debug,
            offline_cache=True,
            offline_cache_file_path=str(_kernel_folder()),
            log_level=ti.ERROR,
            unrolling_limit=0,  # unrolled loops are meant: no warning to the user
            make_cpu_multithreading_loop=False,
            default_cpu_block_dim=1,
            **({"cpu_block_dim_adaptive": False} if NAME == "taichi" else {}),  # the fork has none
        )
    _started.update(wanted)
    return dict(_started)


def running(threads: int | None = None) -> int:
    """Start Taichi; returns its threads. Where it runs already it keeps them: no result depends on it."""
    with contextlib.suppress(RuntimeError):
        start(threads)
    return int(str(start()["threads"]))


def version() -> str:
    """The runtime's version, as recorded in results."""
    return ".".join(str(part) for part in ti.__version__)


def cache_name() -> str:
    """Name of the folder of compiled kernels: the runtime, its version, a digest of these sources."""
    sources = b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))
    return f"{NAME}-{version()}-{hashlib.sha256(sources).hexdigest()[:12]}"


def _kernel_folder() -> Path:
    """Folder of compiled kernels: per user, per version of these sources; temporary if unwritable.

    ``MCSETTLE_KERNELS`` names another one: processes that start by the hundred do not share.
    """
    own = os.environ.get("MCSETTLE_KERNELS")
    try:
        folder = (Path(own) if own else cache_folder()) / cache_name()
        refuse_link(folder)
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder, prefix=".probe-") as probe:
            remove_stale_locks(folder, os.fstat(probe.fileno()).st_mtime)
        return folder
    except (InputError, OSError):
        return Path(tempfile.mkdtemp(prefix="mcsettle-kernels-"))


def remove_stale_locks(folder: Path, now: float) -> None:
    """Remove locks of compiled kernels that a killed process has left: every later start would wait.

    Taichi holds them for milliseconds, so one that is a minute older than ``now`` [s], by the file
    system's own clock, or younger, belongs to nobody.
    """
    for path in folder.glob("*.lock"):
        with contextlib.suppress(OSError):
            if abs(now - path.stat().st_mtime) > STALE_LOCK:
                path.unlink()
