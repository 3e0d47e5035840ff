"""python -m layoutrl.watch writes both of its files, or none, and overwrites nothing of a user's."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest
from PIL import Image

from layoutrl import InputError
from layoutrl.watch import files_of, write


def test_a_disk_that_is_full_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pictures = [Image.new("RGB", (40, 30), color) for color in ("white", "red", "blue")]
    files, fsync = files_of(tmp_path / "films" / "mine"), os.fsync

    def full(descriptor: int) -> None:
        if list(tmp_path.glob("films/*.gif")):  # there is no room for the second
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        fsync(descriptor)

    with monkeypatch.context() as patch:
        patch.setattr("layoutrl.runs.files.os.fsync", full)
        with pytest.raises(
            InputError, match=r"^out: cannot write .*mine\.webp \(No space left on device\); expected a"
        ):
            write(pictures, files)
    assert not list(tmp_path.glob("films/*"))
    write(pictures, files)
    assert sorted(file.name for file in tmp_path.glob("films/*")) == ["mine.gif", "mine.webp"]


def test_a_film_is_named_with_a_suffix_of_its_own_or_without() -> None:
    for name in ("films/mine", "films/mine.gif", "films/mine.webp"):
        assert [str(file) for file in files_of(Path(name))] == ["films/mine.gif", "films/mine.webp"]
    for name in ("mine.mp4", "."):
        with pytest.raises(
            InputError, match=rf"^out: {name} is no \.gif or \.webp file; expected the name of new ones"
        ):
            files_of(Path(name))
