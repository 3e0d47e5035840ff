"""Files that are whole or not there, and locks that end with the process that holds them."""

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

LOCK = "lock"  # of a run that is trained
POLL = 0.1  # seconds between two attempts to lock a file, where the system cannot wait for it


@contextmanager
def locked(file: Path, *, wait: bool) -> Iterator[None]:
    """Inside, no other process holds the file; waits for one that does. However a process ends, it lets go of it.

    Raises InputError where one holds it that is not to be waited for, and where files cannot be locked.
    """
    try:
        stream = file.open("w")  # to be written to: without it, file systems of clusters lock nothing
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

    Raises BlockingIOError where another has locked it and is not to be waited for, OSError where it cannot be locked.
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
    """Raise InputError unless files can be made in a folder, or in one that is to be made; `option` names it."""
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not (there.is_dir() and os.access(there, os.W_OK)):
        raise InputError(f"{option}: {folder} cannot be written to; expected another, as {option}=<name>")


@contextmanager
def writing(file: Path) -> Iterator[None]:
    """Make its folder, and raise InputError where what the option `out` names cannot be written."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        raise InputError(
            f"out: cannot write {file} ({error.strerror}); expected a file in a folder to write to"
        ) from None


def write_whole(file: Path, content: bytes) -> None:
    """Write a file whole or not at all, and onto the disk before its name is there."""
    partial = file.with_name(f"{file.name}.partial")
    try:
        with partial.open("wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(file)
    except BaseException:  # a full disk has no room for what is of no use
        partial.unlink(missing_ok=True)
        raise


def write_json(path: Path, content: Any) -> None:
    """Write a file whole or not at all."""
    write_whole(path, (json.dumps(content, indent=1) + "\n").encode())
