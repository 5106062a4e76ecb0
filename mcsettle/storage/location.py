"""Where results live: a folder, or a prefix of an object store, behind the same five verbs.

Files are written whole or not at all: aside and moved into place in a folder, by one PUT in a store
(``s3://``, ``gs://``, ``abfs://`` through pyarrow). Nothing is reached over a network unless its URL
was given. What is read is bounded in size and number: folders come from others too.
"""

import contextlib
import os
import socket
from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl

from mcsettle.errors import InputError
from mcsettle.storage.files import (
    ASIDE,
    UNFINISHED,
    URL,
    inside,
    read_regular,
    refuse_link,
    writable,
    write_bytes,
)

LARGEST = 2 * 1024**3  # bytes of one file that is read
MOST_FILES = 4_000_000
LONGEST_REASON = 400  # characters of what a store's client says of an error
DEEPEST = 8  # folders below a results folder; ours are one deep
# How long Google's client tries again [s], which is a quarter of an hour unless told: until it has
# been answered once, when URL and credentials are probably wrong, and from then on.
FIRST_PATIENCE, PATIENCE = 1, 60
CONNECT, ANSWER = 2.0, 3.0  # s that a first contact waits for a connection, and for an answer
SCHEMES = ("s3", "gs", "gcs", "abfs", "abfss")


class Place(ABC):
    """A results folder. Names are relative, with ``/``; a part of a hidden one starts with a dot."""

    where: str

    @abstractmethod
    def read(self, name: str, largest: int = LARGEST) -> bytes:
        """Bytes of a file.

        Raises
        ------
        FileNotFoundError
            There is no such file.
        InputError
            It cannot be read, or has more than ``largest`` bytes.
        """

    @abstractmethod
    def write(self, name: str, data: bytes) -> None:
        """Write a file whole or not at all, replacing what is there.

        Raises
        ------
        InputError
            The place cannot be written.
        """

    @abstractmethod
    def remove(self, name: str) -> None:
        """Remove a file; nothing happens if there is none."""

    @abstractmethod
    def names(self, below: str = "") -> list[str]:
        """Names of all files below a folder of the place, unfinished ones left out, sorted."""

    @abstractmethod
    def entries(self) -> list[str]:
        """Names of what lies in the folder itself, hidden or not, sorted."""

    @abstractmethod
    def exists(self) -> bool:
        """Whether there is anything at all."""

    def unfinished(self) -> list[str]:
        """Names of what lies where unfinished files do; only folders have such a place."""
        return []

    def sweep(self) -> None:  # noqa: B027
        """Remove what killed writers have left unfinished; for an exclusive owner only."""

    def tidy(self) -> None:  # noqa: B027
        """Remove the folder of unfinished files if it is empty."""

    def text(self, name: str, largest: int) -> str:
        """A file as UTF-8 text; raises as ``read``, and for other bytes."""
        try:
            return self.read(name, largest).decode("utf-8")
        except UnicodeDecodeError as error:
            raise InputError(f"'{self}/{name}' is damaged: no UTF-8 text") from error

    def __str__(self) -> str:
        return self.where


class Folder(Place):
    """A folder of this machine or of a shared drive; no link in it is followed."""

    def __init__(self, path: Path) -> None:
        self.path, self.where = path, str(path)

    def read(self, name: str, largest: int = LARGEST) -> bytes:
        """Bytes of a file."""
        path = inside(self.path, name)
        refuse_link(path)
        try:
            return read_regular(path, largest)
        except (FileNotFoundError, NotADirectoryError) as error:
            raise FileNotFoundError(error.errno, error.strerror, str(path)) from None
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise InputError(f"'{path}' cannot be read: {reason}") from error

    def write(self, name: str, data: bytes) -> None:
        """Write a file whole or not at all."""
        write_bytes(self.path, name, data)

    def remove(self, name: str) -> None:
        """Remove a file."""
        path = inside(self.path, name)
        with writable(self.path):
            path.unlink(missing_ok=True)

    def names(self, below: str = "") -> list[str]:
        """Names of all files below, sorted."""
        names = []
        for name in self._walk(below):
            names.append(name)
            if len(names) > MOST_FILES:
                raise InputError(f"'{self}' holds more than {MOST_FILES} files; not a run")
        return sorted(names)

    def _walk(self, below: str) -> Iterator[str]:
        top = self.path
        if below:
            top = inside(self.path, below)
            refuse_link(top)
        for folder, inner, files in os.walk(top):
            path = Path(folder)
            relative = path.relative_to(self.path)
            if len(relative.parts) >= DEEPEST:
                raise InputError(f"'{folder}' lies too deep for a results folder; remove it")
            if ASIDE in inner:
                inner.remove(ASIDE)
            for name in inner:
                refuse_link(path / name)
            yield from ((relative / file).as_posix() for file in files)

    def entries(self) -> list[str]:
        """Names of what lies in the folder itself, hidden or not."""
        with writable(self.path):
            return sorted(os.listdir(self.path)) if self.path.is_dir() else []

    def exists(self) -> bool:
        """Whether the folder is there."""
        return self.path.is_dir()

    def unfinished(self) -> list[str]:
        """Names of what lies in the folder of unfinished files."""
        refuse_link(self.path / ASIDE)
        return sorted(p.name for p in (self.path / ASIDE).glob("*"))

    def sweep(self) -> None:
        """Remove unfinished files, and their folder."""
        aside = self.path / ASIDE
        refuse_link(aside)
        with contextlib.suppress(OSError):  # none there, or another writer has just begun
            for path in aside.glob(f"*{UNFINISHED}"):
                path.unlink(missing_ok=True)
        self.tidy()

    def tidy(self) -> None:
        """Remove the folder of unfinished files if it is empty."""
        with contextlib.suppress(OSError):  # not empty: another writer, or what a killed one left
            (self.path / ASIDE).rmdir()


class Bucket(Place):
    """A prefix of an object store: a PUT is atomic there."""

    def __init__(self, url: str) -> None:
        from pyarrow import ArrowException, fs

        self.where = url
        uri = self.where.replace("gcs://", "gs://", 1)
        limited = uri.startswith("gs://") and "retry_limit_seconds" not in uri
        limit = ("&" if "?" in uri else "?") + "retry_limit_seconds="
        try:
            if limited:
                _refuse_silent(uri)
            first = f"{uri}{limit}{FIRST_PATIENCE}" if limited else uri
            self.store, self.prefix = fs.FileSystem.from_uri(first)
            patient = f"{uri}{limit}{PATIENCE}"
            self.patient = fs.FileSystem.from_uri(patient)[0] if limited else None
            if uri.startswith("s3://"):
                self.patient, self.store = self.store, _impatient(self.store)
        except (ArrowException, OSError, ValueError) as error:
            raise InputError(f"{self} cannot be used: {error}") from None

    def __str__(self) -> str:
        return shown(self.where)

    def read(self, name: str, largest: int = LARGEST) -> bytes:
        """Bytes of an object."""
        with self._reached(f"{name} cannot be read"):
            info = self.store.get_file_info(f"{self.prefix}/{name}")
            if info.type.name != "File":
                raise FileNotFoundError(2, "No such object", f"{self}/{name}")
            if info.size > largest:
                raise InputError(f"'{self}/{name}' has {info.size} bytes; at most {largest}")
            with self.store.open_input_file(f"{self.prefix}/{name}") as stream:
                data: bytes = stream.read()
        return data

    def write(self, name: str, data: bytes) -> None:
        """One PUT."""
        with (
            self._reached(f"{name} cannot be written"),
            self.store.open_output_stream(f"{self.prefix}/{name}") as stream,
        ):
            stream.write(data)

    def remove(self, name: str) -> None:
        """Remove an object."""
        with self._reached(f"{name} cannot be removed"), contextlib.suppress(FileNotFoundError):
            self.store.delete_file(f"{self.prefix}/{name}")

    def names(self, below: str = "") -> list[str]:
        """Names of all objects below, sorted."""
        from pyarrow import fs

        root = f"{self.prefix}/{below}".rstrip("/")
        with self._reached("cannot be listed"):
            infos: list[Any] = self.store.get_file_info(
                fs.FileSelector(root, recursive=True, allow_not_found=True)
            )
        files = (info.path[len(self.prefix) :].strip("/") for info in infos if info.is_file)
        return sorted(files)

    def entries(self) -> list[str]:
        """Names of what lies directly below the prefix."""
        from pyarrow import fs

        with self._reached("cannot be listed"):
            infos: list[Any] = self.store.get_file_info(
                fs.FileSelector(self.prefix, recursive=False, allow_not_found=True)
            )
        return sorted(info.base_name for info in infos)

    def exists(self) -> bool:
        """Whether any object is there."""
        with self._reached("cannot be listed"):
            return bool(self.store.get_file_info(self.prefix).type.name != "NotFound")

    @contextlib.contextmanager
    def _reached(self, what: str) -> Iterator[None]:
        """Turn what the store refuses into one the user can act on."""
        from pyarrow import ArrowException

        try:
            yield
        except FileNotFoundError:
            raise
        except (ArrowException, OSError) as error:  # the former: Azure's, without credentials
            reason = " ".join(str(error).split())[:LONGEST_REASON]
            raise InputError(
                f"{self}: {what} ({reason}); check the URL and the credentials: the same "
                "command goes on from what is there"
            ) from error
        if self.patient is not None:
            self.store, self.patient = self.patient, None


def shown(url: str) -> str:
    """A URL without what follows a question mark or precedes an at sign: keys may stand there.

    Azure's container stands there too, and is kept.
    """
    scheme, slashes, rest = url.rpartition("://")
    owner, at, path = rest.partition("?")[0].rpartition("@")
    kept = scheme.startswith("abfs") and ":" not in owner
    return f"{scheme}{slashes}{owner + at if kept else ''}{path}"


def _impatient(store: Any) -> Any:
    """The same S3 store for a first contact: one that never answers is soon said to."""
    from pyarrow import fs

    options = dict(store.__reduce__()[1][0])  # what another process is given to make it
    options |= {"connect_timeout": CONNECT, "request_timeout": ANSWER}
    return fs.S3FileSystem(**options, retry_strategy=fs.AwsStandardS3RetryStrategy(max_attempts=2))


def _refuse_silent(url: str) -> None:
    """Refuse a server, where the URL names one, that takes connections and does not answer them.

    Google's client would wait for two minutes, whatever it is told.

    Raises
    ------
    OSError
        It does not answer.
    """
    options = dict(parse_qsl(url.partition("?")[2]))
    server = options.get("endpoint_override")
    if server is None:
        return
    secure = options.get("scheme", "https") != "http"
    host, _, port = server.rpartition("://")[2].partition(":")
    address = (host, int(port) if port.isdigit() else 443 if secure else 80)
    try:
        with socket.create_connection(address, timeout=CONNECT) as line:
            line.settimeout(ANSWER)
            if not secure:
                line.sendall(f"HEAD / HTTP/1.1\r\nHost: {server}\r\n\r\n".encode())
                line.recv(1)
    except TimeoutError:
        raise OSError(f"{server} does not answer within {ANSWER:g} s") from None
    except OSError:  # the client says what is wrong
        return


Where = Path | str | Place


def place(where: Where) -> Place:
    """The place that a path or URL names.

    Raises
    ------
    InputError
        A URL that pyarrow cannot serve, or of another kind; an empty name.
    """
    if isinstance(where, Place):
        return where
    text = str(where)
    if not text:
        raise InputError("the folder's name is empty; give a name, or '.' for the current folder")
    url = URL.match(text)
    if url is None:
        return Folder(Path(where))
    scheme, rest = url[1].lower(), text[url.end() :].rstrip("/")
    if scheme not in SCHEMES:
        remedy = (
            f"did you mean s3://{shown(rest)}?"
            if scheme.startswith("s3")
            else ("give a folder, or a URL that begins with s3://, gs:// or abfs://")
        )
        raise InputError(f"{scheme}:// is not served here; {remedy}")
    return Bucket(f"{scheme}://{rest}")
