"""What is locked is waited for, or answered."""

from __future__ import annotations

import errno
import os
import sys
import threading
from types import SimpleNamespace

import pytest

from layoutrl import InputError
from layoutrl.runs import files
from layoutrl.runs.files import locked

LK_NBLCK = 2  # of Windows


def locking(descriptor: int, mode: int, count: int) -> None:
    """As Windows locks bytes: what another has is answered at once, by the error of missing rights."""
    import fcntl

    assert (mode, count) == (LK_NBLCK, 1)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES)) from None


@pytest.fixture(params=["this system", "Windows"])
def system(request, monkeypatch) -> str:
    """Where files are locked. On Windows nothing is changed; elsewhere its locks are played by those that there are."""
    if request.param == "Windows" and sys.platform != "win32":
        monkeypatch.setattr(files, "sys", SimpleNamespace(platform="win32"))
        monkeypatch.setitem(sys.modules, "msvcrt", SimpleNamespace(locking=locking, LK_NBLCK=LK_NBLCK))
    return request.param


def test_who_waits_for_a_file_goes_on_when_it_is_let_go_of(system, tmp_path):
    order = []

    def second():
        with locked(tmp_path / "lock", wait=True):
            order.append("second")

    waiting = threading.Thread(target=second)
    with locked(tmp_path / "lock", wait=True):
        waiting.start()
        waiting.join(0.2)
        order.append("first")
    waiting.join(10)
    assert order == ["first", "second"]


def test_who_does_not_wait_for_a_file_is_answered(system, tmp_path):
    with (
        locked(tmp_path / "lock", wait=False),
        pytest.raises(InputError, match="is in use by another process; expected it to end first"),
        locked(tmp_path / "lock", wait=False),
    ):
        pass
    with locked(tmp_path / "lock", wait=False):
        pass


def test_a_file_system_without_locks_is_answered(system, tmp_path, monkeypatch):
    def no_locks(*_):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    on_windows = system == "Windows" or sys.platform == "win32"
    monkeypatch.setattr("msvcrt.locking" if on_windows else "fcntl.flock", no_locks)
    with (
        pytest.raises(InputError, match="expected a folder on a file system with locks"),
        locked(tmp_path / "lock", wait=True),
    ):
        pass
