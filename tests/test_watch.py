"""python -m layoutrl.watch writes both of its files, or none, and overwrites nothing of a user's."""

from __future__ import annotations

import errno
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from layoutrl import InputError
from layoutrl.rooms.room import Item
from layoutrl.runs.config import LARGEST, WatchConfig
from layoutrl.watch import FRAMES_A_MOVE, Episode, files_of, frames, write
from tests.builders import rectangular_room


def test_a_disk_that_is_full_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pictures = [Image.new("RGB", (40, 30), color) for color in ("white", "red", "blue")]
    files, write_bytes = files_of(tmp_path / "films" / "mine"), Path.write_bytes

    def full(file: Path, content: bytes) -> int:
        if ".webp" in file.name:  # there is no room for the second
            write_bytes(file, content[:10])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write_bytes(file, content)

    def written() -> None:
        with monkeypatch.context() as patch:
            patch.setattr(Path, "write_bytes", full)
            with pytest.raises(
                InputError, match=r"^out: cannot write .*mine\.webp \(No space left on device\); expected a"
            ):
                write(pictures, files)

    written()
    assert not list(tmp_path.glob("films/*"))
    write(pictures[:2], files)
    before = [file.read_bytes() for file in files]
    written()
    assert sorted(tmp_path.glob("films/*")) == files
    assert [file.read_bytes() for file in files] == before
    write(pictures, files)
    assert [file.read_bytes() for file in files] != before


def test_a_room_where_nothing_has_a_place_is_shown_bare() -> None:
    room = rectangular_room(3.0, 2.0)
    placed, shell = room.moving, replace(room, furniture=(), target=None)
    nothing, something = Episode(shell, [], [], 0.0), Episode(shell, [(0, placed), (0, placed)], [placed], 1.0)
    several = Episode(shell, [(0, placed), (0, placed), (1, placed), (0, placed)], [placed], 1.0)
    assert (nothing.moves, something.moves, several.moves) == (0, 1, 1)
    assert len(list(frames([nothing], width=60))) == 2
    assert len(list(frames([nothing, something], width=60))) == len(list(frames([something], width=60)))


def test_the_most_rooms_of_a_width_are_as_high_as_a_film_may_be() -> None:
    room = rectangular_room(3.0, 2.0)
    bare = Episode(replace(room, furniture=(), target=None), [], [], 0.0)
    for rooms, width in ((9, LARGEST), (18, 720), (135, 100)):  # as many as the command takes of each width
        WatchConfig("nowhere", rooms=rooms, width=width)
        with pytest.raises(InputError, match=rf"^rooms: expected at most {rooms} with width={width}"):
            WatchConfig("nowhere", rooms=rooms + 1, width=width)
    first, *_ = frames([bare] * 9, 60)
    assert first.size == (60, 60)


def test_a_film_ends_with_all_that_was_placed_where_it_stays() -> None:
    room = rectangular_room(3.0, 2.0)
    bed, shell = room.moving, replace(room, furniture=(), target=None)
    lamp = Item("lamp", (0.3, 0.3), (2.7, 1.7), 0.0)
    away = replace(bed, center=(1.0, 1.0))
    way = [(0, away), (0, bed), (1, replace(lamp, center=(2.0, 1.0))), (1, lamp)]  # two moves, and a take
    *_, before_last, last = frames([Episode(shell, way, [bed, lamp], 1.0)], width=200)
    *_, standing, _ = frames([Episode(shell, [(0, bed), (1, lamp)], [bed, lamp], 1.0)], width=200)
    picture, expected = (np.asarray(image, dtype=int) for image in (before_last, standing))
    red = (expected[..., 0] > 200) & (expected[..., 1] < 120)  # the lamp, where it stays
    assert red.sum() > 20
    assert np.median(np.abs(picture - expected)[red]) < 30  # the line of its way is drawn over it
    assert last != before_last


def test_a_long_film_goes_faster(monkeypatch: pytest.MonkeyPatch) -> None:
    room = rectangular_room(3.0, 2.0)
    bed, shell = room.moving, replace(room, furniture=(), target=None)
    way = [(0, replace(bed, center=(1.0 + k / 100, 1.0))) for k in range(40)]
    monkeypatch.setattr("layoutrl.watch.MOST_FRAMES", 5)
    *film, there, _ = frames([Episode(shell, way, [bed], 1.0)], width=60)
    assert len(film) == 4
    assert there == list(frames([Episode(shell, [*way, way[-1]], [bed], 1.0)], width=60))[-2]


def test_what_is_taken_up_again_does_not_move_there() -> None:
    room = rectangular_room(3.0, 2.0)
    bed, shell = room.moving, replace(room, furniture=(), target=None)
    way = [(0, replace(bed, center=(x, y))) for x, y in ((0.5, 0.5), (0.6, 0.5), (2.4, 1.5), (2.5, 1.5))]
    jumps = Episode(shell, way, [bed], 1.0, frozenset({0, 2}))
    stands, later = (Episode(shell, some, [bed], 1.0) for some in (way[:2], way[2:]))
    assert (jumps.moves, replace(jumps, taken=frozenset()).moves) == (2, 3)
    *film, _ = frames([jumps], width=120)
    (*_, there, _), (*again, _) = (frames([each], width=120) for each in (stands, later))
    assert film[FRAMES_A_MOVE : 2 * FRAMES_A_MOVE] == [there] * FRAMES_A_MOVE  # it stays, and then is elsewhere
    assert film[2 * FRAMES_A_MOVE :] == again


def test_a_film_is_named_with_a_suffix_of_its_own_or_without() -> None:
    for name in ("films/mine", "films/mine.gif", "films/mine.webp"):
        assert [str(file) for file in files_of(Path(name))] == ["films/mine.gif", "films/mine.webp"]
    assert [str(file) for file in files_of(Path("rate0.5"))] == ["rate0.5.gif", "rate0.5.webp"]
    for name in (".", ".."):
        with pytest.raises(InputError, match=r"^out: \.* is no name of a file; expected one"):
            files_of(Path(name))
