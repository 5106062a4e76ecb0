"""What this installation consists of, whether its parts work, and what to do where they do not."""

import importlib.metadata
import os
import platform
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mcsettle.errors import InputError
from mcsettle.step_a.processes import cores
from mcsettle.storage.files import cache_folder

PYTHON_FROM, PYTHON_BELOW = (3, 11), (3, 14)  # as in pyproject.toml
LIBRARIES = (
    "numpy", "scipy", "pandas", "pyarrow", "pydantic", "scikit-fem", "matplotlib", "rich",
    "typer", "pint", "jinja2", "filelock", "taichi", "tomli-w",
)  # fmt: skip
TAICHI = "1.7.4"
# What may be installed besides: extra, its library, the version it has to be (None: any), what it is for.
EXTRAS = (
    ("distributed", "distributed", "2026.8.0", "run --scheduler"),
    ("pdf", "playwright", None, "report --pdf"),
    ("quadrants", "quadrants", "1.3.3", "MCSETTLE_RUNTIME=quadrants"),
    ("xarray", "xarray", None, "Results.to_xarray"),
    ("xlsx", "XlsxWriter", None, "export to a workbook"),
)
STORES = {"s3": "S3FileSystem", "gs": "GcsFileSystem", "abfs": "AzureFileSystem"}
PRECISION = 1e-13  # of the smoke kernel: some hundred roundings of double precision
LEAST_DISK = 2 * 1024**3  # bytes: a large study's results and its cache
LEFTOVER_AGE = 3600.0  # s, after which an unfinished cache file belongs to no running process
GIB, MIB = 1024**3, 1024**2


@dataclass(frozen=True)
class Check:
    """One thing looked at: ``state`` is "ok", "note" or "failed"; ``advice`` says what to do."""

    name: str
    state: str
    found: str
    advice: str = ""


def examine() -> list[Check]:
    """Look at everything; never raises."""
    checks: tuple[Callable[[], Check], ...] = (
        _python, _libraries, _extras, _stores, _threads, _kernels, _cache, _stale, _disk,
    )  # fmt: skip
    return [_guarded(check) for check in checks]


def _guarded(check: Callable[[], Check]) -> Check:
    try:
        return check()
    except Exception as error:  # a doctor that falls ill helps nobody
        name = check.__name__.strip("_")
        return Check(name, "failed", f"{type(error).__name__}: {error}", "report this message")


def _judged(name: str, facts: str, fine: bool, advice: str, ill: str = "failed") -> Check:
    """What was looked at; ``ill`` and with ``advice`` where it is not fine."""
    return Check(name, "ok", facts) if fine else Check(name, ill, facts, advice)


def _python() -> Check:
    facts = f"{platform.python_version()} on {platform.platform()}"
    fine = PYTHON_FROM <= sys.version_info[:2] < PYTHON_BELOW
    span = f"{_dotted(PYTHON_FROM)} or newer, below {_dotted(PYTHON_BELOW)}"
    return _judged("python", facts, fine, f"install mcsettle into a Python of version {span}")


def _libraries() -> Check:
    from mcsettle import __version__

    versions, missing = [f"mcsettle {__version__}"], []
    for name in LIBRARIES:
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            missing.append(name)
    facts = ", ".join(versions)
    if missing:
        advice = f"pip install {' '.join(missing)}"
        return Check("libraries", "failed", f"{facts}; missing: {', '.join(missing)}", advice)
    fine = f"taichi {TAICHI}" in versions
    return _judged("libraries", facts, fine, f"pip install taichi=={TAICHI}")


def _extras() -> Check:
    """Optional libraries: missing ones are told with what they would do, and are no fault."""
    told, wrong = [], []
    for extra, library, wanted, purpose in EXTRAS:
        install = f"pip install 'mcsettle[{extra}]'"
        try:
            version = importlib.metadata.version(library)
        except importlib.metadata.PackageNotFoundError:
            told.append(f"{extra} not installed ({install} for {purpose})")
            continue
        told.append(f"{library} {version}")
        if wanted not in (None, version):
            wrong.append(f"{install}: {purpose} wants {library} {wanted} everywhere")
    return Check("extras", "note" if wrong else "ok", ", ".join(told), "; ".join(wrong))


def _stores() -> Check:
    """Which object stores the installed pyarrow was built for; nothing is reached."""
    import pyarrow
    from pyarrow import fs

    missing = [scheme for scheme, name in STORES.items() if not hasattr(fs, name)]
    told = [f"{scheme}:// {'no' if scheme in missing else 'yes'}" for scheme in STORES]
    facts = f"{', '.join(told)} (pyarrow {pyarrow.__version__})"
    advice = "for those that are missing install another build of pyarrow, such as pip's own"
    return _judged("object stores", facts, not missing, advice, "note")


def _threads() -> Check:
    ours, machine = cores(), os.cpu_count() or 1
    blas = os.environ.get("OPENBLAS_NUM_THREADS", "not set")
    facts = f"{ours} of {machine} cores for this process, OPENBLAS_NUM_THREADS {blas}"
    advice = "set OPENBLAS_NUM_THREADS=1: the work is parallel elsewhere, more only get in the way"
    return _judged("threads", facts, blas == "1" or ours <= 1, advice, "note")


def _kernels() -> Check:
    """Compile and run a kernel in double precision, compare with NumPy."""
    try:
        from mcsettle.kernels import backend, runtime, smoke

        started = time.monotonic()
        runtime.start()
        error = smoke.largest_error()
    except Exception as failure:
        advice = (
            f"pip install --force-reinstall taichi=={TAICHI}, or quadrants where MCSETTLE_RUNTIME "
            "says so; it needs a 64-bit x86 or ARM processor and glibc 2.27 or newer"
        )
        return Check("kernels", "failed", f"{type(failure).__name__}: {failure}", advice)
    took = time.monotonic() - started
    facts = f"{backend.NAME} {runtime.version()}, one against NumPy: {error:.1e} ({took:.1f} s)"
    advice = "results would be wrong: reinstall the compiler, and report the processor if that is no cure"
    return _judged("kernels", facts, error <= PRECISION, advice)


def _cache() -> Check:
    """Exists, can be written, its size."""
    try:
        folder = cache_folder()
        with tempfile.TemporaryFile(dir=folder):
            pass
    except (InputError, OSError) as error:
        return Check("cache", "failed", str(error), "set MCSETTLE_CACHE to a folder you may write")
    files = [path for path in folder.rglob("*") if path.is_file()]
    size = sum(path.stat().st_size for path in files) / MIB
    return Check("cache", "ok", f"{folder}: {len(files)} files, {size:.0f} MiB")


def _stale() -> Check:
    """Cached files that nothing will read again: older kernels, unfinished writes."""
    folder = cache_folder()
    old = stale_files(folder, time.time())
    if not old:
        return Check("stale cache", "ok", "none")
    size = sum(_size(path) for path in old) / MIB
    advice = "safe to delete: " + " ".join(str(path) for path in old)
    return Check("stale cache", "note", f"{len(old)} entries, {size:.1f} MiB", advice)


def stale_files(folder: Path, now: float) -> list[Path]:
    """Entries of the cache ``folder`` that no version installed here will read again.

    Compiled kernels of other sources or another version, and files that a writer left unfinished more
    than an hour before ``now`` [s since 1970].
    """
    from mcsettle.kernels import backend, runtime

    current = runtime.cache_name()
    kernels = [p for p in folder.glob(f"{backend.NAME}-*") if p.name != current]
    unfinished = [
        path
        for path in folder.glob(".*")
        if path.is_file() and now - path.stat().st_mtime > LEFTOVER_AGE
    ]
    return sorted(kernels) + sorted(unfinished)


def _disk() -> Check:
    folder = cache_folder()
    free = shutil.disk_usage(folder).free
    facts = f"{free / GIB:.1f} GiB free at {folder}"
    advice = "make room, or set MCSETTLE_CACHE and --out to a disk with 2 GiB to spare"
    return _judged("disk", facts, free >= LEAST_DISK, advice)


def _size(path: Path) -> int:
    if path.is_file():
        return path.stat().st_size
    return sum(inner.stat().st_size for inner in path.rglob("*") if inner.is_file())


def _dotted(version: tuple[int, int]) -> str:
    return ".".join(str(part) for part in version)
