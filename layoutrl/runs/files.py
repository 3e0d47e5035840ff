"""Atomic writing of files, and locks that end with the process that holds them."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from layoutrl import InputError

LOCK = "lock"  # name of the file to lock in a folder that is written to
POLL = 0.1  # seconds between two attempts to lock a file, where the system cannot wait for it


@contextmanager
def locked(file: Path, *, wait: bool) -> Iterator[None]:
    """Context that holds an exclusive lock on a file, which is released however the process ends.

    With `wait` it waits for another process that holds it. Raises InputError if one does without `wait`, and if the
    file cannot be written or locked.
    """
    try:
        stream = file.open("w")  # opened for writing, or file systems of clusters lock nothing
    except OSError as error:
        raise InputError(f"cannot write {file} ({error.strerror}); expected a folder to write to") from None
    with stream:
        try:
            _lock(stream.fileno(), wait)
        except BlockingIOError:
            raise InputError(f"{file.parent} is in use by another process; expected it to end first") from None
        except OSError as error:
            raise InputError(
                f"cannot lock {file} ({error.strerror}); expected a folder on a file system with locks"
            ) from None
        yield


def _lock(descriptor: int, wait: bool) -> None:
    """Lock an open file until it is closed.

    Raises BlockingIOError if another process has locked it and `wait` is false, OSError if it cannot be locked.
    """
    if sys.platform == "win32":
        import msvcrt

        while True:
            try:
                msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # the first byte, which need not be there
                return
            except PermissionError:  # another has it; Windows' own way of waiting gives up after ten seconds
                if not wait:
                    raise BlockingIOError from None
                time.sleep(POLL)
    else:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)


def check_writable(folder: Path, option: str) -> None:
    """Raise InputError unless files can be made in a folder, which need not exist yet; `option` is what names it."""
    # A link to nothing is there, too: nothing can be made in it.
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists() or path.is_symlink())
    if not (there.is_dir() and os.access(there, os.W_OK)):
        raise InputError(f"{option}: {folder} cannot be written to; expected another, as {option}=<name>")


@contextmanager
def writing(file: Path) -> Iterator[None]:
    """Context to write a file of the option `out`: makes its folder, and raises InputError for an OSError."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        raise InputError(
            f"out: cannot write {file} ({error.strerror}); expected a file in a folder to write to"
        ) from None


def write_whole(file: Path, content: bytes) -> None:
    """Write a file whole or not at all: it gets its name when its content is on the disk."""
    partial = file.with_name(f"{file.name}.partial")
    try:
        with partial.open("wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(file)
    except BaseException:  # the partial file is of no use, and the disk may be full
        partial.unlink(missing_ok=True)
        raise


def write_json(path: Path, content: Any) -> None:
    """Write content as JSON, whole or not at all."""
    write_whole(path, (json.dumps(content, indent=1) + "\n").encode())
