"""What systems without POSIX lack is hidden here: the command does without it."""

import os
import subprocess
import sys
from pathlib import Path

from mcsettle.storage.files import cache_folder

KERNELS = str(cache_folder())  # compiled ones
HIDDEN = """
import builtins, io, os, pathlib, signal, sys
for name in ("fcntl", "resource", "termios", "pwd", "grp", "tty", "pty", "syslog"):
    sys.modules[name] = None
for name in ("fork", "forkpty", "sched_getaffinity", "getuid", "geteuid", "getgid", "getpgid", "setsid",
             "killpg", "mkfifo", "chown", "nice", "getloadavg"):
    if hasattr(os, name):
        delattr(os, name)
for name in ("SIGHUP", "SIGKILL", "SIGALRM", "SIGUSR1", "SIGPIPE", "setitimer", "alarm", "SIGCHLD"):
    if hasattr(signal, name):
        delattr(signal, name)

def without_proc(function):
    def called(path, *arguments, **options):
        if str(path).startswith(("/proc", "/etc/machine-id")):
            raise FileNotFoundError(2, "No such file or directory", str(path))
        return function(path, *arguments, **options)
    return called

builtins.open = io.open = without_proc(io.open)
os.readlink = without_proc(os.readlink)
from mcsettle.cli.app import app
app(sys.argv[1:])
"""


def command(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", HIDDEN, *words], capture_output=True, text=True, check=False, cwd=folder,
        env=os.environ | {"MCSETTLE_KERNELS": KERNELS, "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip


def test_a_study_is_checked_without_what_posix_adds(tmp_path: Path, toy_path: Path) -> None:
    done = command(tmp_path, "check", str(toy_path))
    assert done.returncode == 0, done.stderr
    assert "sound" in done.stdout


def test_what_is_hidden_is_missing(tmp_path: Path) -> None:
    """The test above is one: an import of what is hidden fails."""
    program = HIDDEN.replace("from mcsettle.cli.app import app\napp(sys.argv[1:])", "import fcntl")
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert "ModuleNotFoundError" in done.stderr or "ImportError" in done.stderr
