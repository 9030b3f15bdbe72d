"""Files that are there whole or not at all, written by one process at a time."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from . import InputError

#: What the name of a file that is being written begins with.
PART = ".part."


@contextlib.contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A path to write to, whose file takes the place of `path` when all is written.

    What fails or is interrupted leaves what was there. A link is replaced, not followed, also one
    in place of the file being written; a device is written to. Raises OSError, naming the path.
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


def check_end(path: Path, *ends: str) -> None:
    """Raise OSError (no space left) if a file that another program has written is missing or does
    not end in one of the ways it should: programs that do not check their writes leave half of a
    file on a full disk.
    """
    last = b""
    with contextlib.suppress(FileNotFoundError), path.open("rb") as file:
        file.seek(max(0, file.seek(0, os.SEEK_END) - max(map(len, ends))))
        last = file.read()
    if not last.endswith(tuple(end.encode() for end in ends)):
        free = shutil.disk_usage(path.parent).free
        said = f"not written whole ({free} bytes are free in its folder)"
        raise OSError(errno.ENOSPC, said, str(path))


def lock(file: int, path: Path) -> None:
    """Keep an open file, or folder, from all who ask for it so, until it is closed or the process
    ends.

    Raises InputError if another has it.
    """
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(f"out = {path}: another damjoint is writing there") from None
    except OSError:  # a file system without locks
        return


@contextlib.contextmanager
def held(folder: Path) -> Iterator[None]:
    """`lock` for a folder."""
    number = os.open(folder, os.O_RDONLY)
    try:
        lock(number, folder)
        yield
    finally:
        os.close(number)
