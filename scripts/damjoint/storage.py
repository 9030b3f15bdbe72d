"""Cache folder and its entries, atomic writes, locks on files and folders, detection of truncated
files.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

from . import InputError

#: Prefix of the temporary file beside a file that is being written.
PART = ".part."

#: Tables of results, with rows, that this process has written: what an interrupt leaves.
SAVED = set[Path]()


@contextlib.contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Yield a temporary path that replaces `path` at the end of the block.

    After an error or interrupt in the block the old file remains. Links, also at the temporary
    path, are replaced and not followed; a device is written directly. Raises OSError with the path.
    """
    if path.exists() and not (path.is_file() or path.is_dir()):  # /dev/stdout
        yield path
        return
    part = path.with_name(PART + path.name)
    try:
        part.unlink(missing_ok=True)
        yield part
        part.replace(path)
    except OSError as error:
        if not error.errno:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def cache_folder() -> Path | None:
    """Folder of data computed once: $DAMJOINT_CACHE (empty: none), or in the user's cache."""
    named = os.environ.get("DAMJOINT_CACHE")
    if named is not None:
        return Path(named) if named else None
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(home) / "damjoint" if os.path.isabs(home) else None


def checksum(file: BinaryIO) -> bytes:
    """Checksum of the rest of a file, as a line of MARK bytes."""
    total = 0
    while block := file.read(BLOCK):
        total = zlib.crc32(block, total)
    return b"%08x\n" % total


#: Bytes of the line with the checksum, and of the blocks that are read for it.
MARK, BLOCK = 9, 1 << 20


@contextlib.contextmanager
def write_entry(path: Path, key: str) -> Iterator[BinaryIO]:
    """Write an entry of the cache: the checksum of all that follows, a line; its key, all that it
    depends on, a line; its content, which the block writes.

    Raises OSError.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(path) as part, part.open("x+b") as file:  # never through a link
        file.write(bytes(MARK) + json.dumps(key).encode() + b"\n")
        yield file
        file.seek(MARK)
        mark = checksum(file)
        file.seek(0)
        file.write(mark)


@contextlib.contextmanager
def read_entry(path: Path, key: str) -> Iterator[BinaryIO]:
    """Open an entry of the cache at its content.

    Raises OSError if there is none; ValueError if any byte of it has changed, or if it has another
    key.
    """
    if not path.is_file():  # a pipe would be waited for
        raise FileNotFoundError(errno.ENOENT, "no file", str(path))
    with path.open("rb") as file:
        if file.read(MARK) != checksum(file):
            raise ValueError(f"{path}: damaged")
        file.seek(MARK)
        if file.readline() != json.dumps(key).encode() + b"\n":
            raise ValueError(f"{path}: of another key")
        yield file


def cached(kind: str, key: str, compute: Callable[[], Any]) -> Any:
    """A value of JSON from the cache folder, or computed and added to it; key: all that it depends
    on. An entry that is damaged or of another key is replaced; one that cannot be written only
    costs the entry.
    """
    parent = cache_folder()
    if parent is None:
        return compute()
    path = parent / f"{kind}-{zlib.crc32(key.encode()):08x}.json"
    with contextlib.suppress(OSError, ValueError), read_entry(path, key) as file:
        return json.load(file)
    value = compute()
    with contextlib.suppress(OSError), write_entry(path, key) as file:
        file.write(json.dumps(value).encode())
    return value


def read_limited_text(path: Path, name: str, most: int) -> str:
    """The text of a regular file of at most `most` bytes; name: of the file in a message.

    Raises InputError.
    """
    try:
        if path.exists() and not path.is_file():  # reading a pipe or a device may not end
            raise InputError(f"{name}: must be a regular file, not a folder, pipe or device")
        if path.stat().st_size > most:
            raise InputError(f"{name}: must be a text of at most {most} bytes")
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{name}: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{name}: {error}") from None


def check_end(path: Path, *ends: str) -> None:
    """Raise OSError (ENOSPC) if a file is missing or ends in none of `ends`.

    GetDP and Gmsh do not check their writes: on a full disk they leave a truncated file.
    """
    last = b""
    with contextlib.suppress(FileNotFoundError), path.open("rb") as file:
        file.seek(max(0, file.seek(0, os.SEEK_END) - max(map(len, ends))))
        last = file.read()
    if not last.endswith(tuple(end.encode() for end in ends)):
        import shutil

        free = shutil.disk_usage(path.parent).free
        message = f"truncated; its folder has {free} bytes free"
        raise OSError(errno.ENOSPC, message, str(path))


def lock(file: int, path: Path) -> None:
    """Take an exclusive lock on an open file or folder, until it is closed or the process ends.

    Raises InputError if another process holds it.
    """
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(f"out = {path}: another damjoint is writing to it") from None
    except OSError:  # a file system without locks
        return


@contextlib.contextmanager
def locked_folder(folder: Path) -> Iterator[None]:
    """Hold the exclusive lock on a folder. Raises InputError if another process holds it."""
    number = os.open(folder, os.O_RDONLY)
    try:
        lock(number, folder)
        yield
    finally:
        os.close(number)
