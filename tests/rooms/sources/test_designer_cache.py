"""The cache of designed rooms."""

from __future__ import annotations

import hashlib
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest

from layoutrl.rooms import clearances
from layoutrl.rooms import designer as rules
from layoutrl.rooms.designer import generator
from layoutrl.rooms.designer.generator import Design, Designs, Part, design_room, design_rooms
from layoutrl.rooms.room import MAIN_ITEM
from layoutrl.rooms.sources import designer_cache

PROJECT = Path(__file__).parents[3]
DESIGN = """
import multiprocessing, signal, sys
from pathlib import Path
from layoutrl.rooms.sources import designer_cache
signal.signal(signal.SIGINT, signal.default_int_handler)  # which what begins in the background of a shell lacks
multiprocessing.set_start_method(sys.argv[1])
designer_cache.BLOCK = 20
designer_cache.read(Path(sys.argv[2]), "balcony", "train", 0, 100_000)
"""


@pytest.fixture(autouse=True)
def fresh_hash() -> None:
    designer_cache.rules_hash.cache_clear()


@pytest.fixture
def designed(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The indices of the rooms that are designed from here on."""
    indices: list[int] = []

    def noted(room_type: str, part: Part, seed: int, index: int) -> Design:
        indices.append(index)
        return design_room(room_type, part, seed, index)

    monkeypatch.setattr(generator, "design_room", noted)
    return indices


def same(a: Designs, b: Designs) -> bool:
    """Whether designs are equal to the last bit and in all orders: checkpoints hold a hash of repr(rooms)."""
    return repr((a.rooms, list(a.made.items()), list(a.rejected.items()))) == repr(
        (b.rooms, list(b.made.items()), list(b.rejected.items()))
    ) and (a == b)


@pytest.mark.parametrize("room_type", MAIN_ITEM)
def test_a_second_start_reads_what_the_first_designed(room_type: str, tmp_path: Path, designed: list[int]) -> None:
    expected = design_rooms(room_type, "train", 0, 12)
    first = designer_cache.read(tmp_path / "new", room_type, "train", 0, 12)
    designed.clear()
    second = designer_cache.read(tmp_path / "new", room_type, "train", 0, 12)
    assert not designed
    assert same(first, expected)
    assert same(second, expected)
    assert str(second) == str(expected)


def test_numbers_are_read_to_the_last_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    room = design_room("bedroom", "train", 0, 0).room
    odd = (0.1 + 0.2, -0.0, 5e-324, 1 / 3, -1000.0, 2.0**-1074 + 1)
    ring = tuple(zip(odd[::2], odd[1::2], strict=True))
    items = tuple(replace(item, center=odd[:2], size=odd[2:4], rotation=odd[4]) for item in room.furniture)
    kept = Designs([replace(room, outline=ring, walls=(ring, ring), furniture=items)], Counter(a=3), Counter())
    monkeypatch.setattr(designer_cache, "design_each", lambda *_: (each for each in (kept,)))
    designer_cache.read(tmp_path, "bedroom", "train", 0, 1)
    monkeypatch.setattr(designer_cache, "design_each", lambda *_: (each for each in ()))
    assert same(designer_cache.read(tmp_path, "bedroom", "train", 0, 1), kept)


@pytest.mark.parametrize(
    "other",
    [("study", "train", 0, 5), ("bedroom", "test", 0, 5), ("bedroom", "train", 1, 5), ("bedroom", "train", 0, 6)],
)
def test_type_part_seed_and_count_have_files_of_their_own(tmp_path: Path, other: tuple) -> None:
    bedrooms = designer_cache.read(tmp_path, "bedroom", "train", 0, 5)
    others = designer_cache.read(tmp_path, *other)
    assert same(others, design_rooms(*other))
    first, second = tmp_path.iterdir()
    first.write_bytes(second.read_bytes())  # under a name that is not its own
    assert same(designer_cache.read(tmp_path, "bedroom", "train", 0, 5), bedrooms)
    assert same(designer_cache.read(tmp_path, *other), others)


def test_what_lacks_is_designed_and_no_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, designed: list[int]
) -> None:
    monkeypatch.setattr(designer_cache, "BLOCK", 4)
    designer_cache.read(tmp_path, "tatami", "train", 0, 10)
    assert len(list(tmp_path.iterdir())) == 3
    (middle,) = tmp_path.glob("tatami-train-seed0-4-8-*.json")
    middle.unlink()
    designed.clear()
    assert same(designer_cache.read(tmp_path, "tatami", "train", 0, 12), design_rooms("tatami", "train", 0, 12))
    assert designed[:8] == [*range(4, 12)]  # the last block was of two rooms


def test_what_was_designed_before_a_stop_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, designed: list[int]
) -> None:
    monkeypatch.setattr(designer_cache, "BLOCK", 4)
    noted = generator.design_room

    def stopped(room_type: str, part: Part, seed: int, index: int) -> Design:
        if index == 6:
            raise KeyboardInterrupt
        return noted(room_type, part, seed, index)

    monkeypatch.setattr(generator, "design_room", stopped)
    with pytest.raises(KeyboardInterrupt):
        designer_cache.read(tmp_path, "tatami", "train", 0, 10)
    assert len(list(tmp_path.iterdir())) == 1
    monkeypatch.setattr(generator, "design_room", noted)
    designed.clear()
    rooms = designer_cache.read(tmp_path, "tatami", "train", 0, 10)
    assert designed == [*range(4, 10)]
    assert same(rooms, design_rooms("tatami", "train", 0, 10))


@pytest.mark.parametrize(
    ("method", "number", "to_all"),
    [("fork", signal.SIGINT, True), ("spawn", signal.SIGINT, True), ("fork", signal.SIGKILL, False)],
)
def test_ctrl_c_or_a_kill_ends_all_processes_at_once_and_keeps_rooms(
    method: str, number: signal.Signals, to_all: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    environment = os.environ | {"PYTHONPATH": str(PROJECT), "OMP_NUM_THREADS": "1"}
    process = subprocess.Popen(
        [sys.executable, "-c", DESIGN, method, str(tmp_path)],
        env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    while not any(tmp_path.glob("*.json")):
        assert process.poll() is None
        time.sleep(0.01)
    (os.killpg if to_all else os.kill)(process.pid, number)  # a terminal sends Ctrl-C to all processes
    began = time.monotonic()
    try:
        _, errors = process.communicate(timeout=20)  # until the last process that can write there has ended
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    assert time.monotonic() - began < 10
    assert process.returncode == -number
    assert errors.count("KeyboardInterrupt") == (number == signal.SIGINT)  # of the parent alone
    assert ("Traceback" in errors) == (number == signal.SIGINT)  # twice, where it comes while another error is handled

    monkeypatch.setattr(designer_cache, "BLOCK", 20)
    stop = max(int(file.name.split("-")[4]) for file in tmp_path.glob("*.json")) + 10
    rooms = designer_cache.read(tmp_path, "balcony", "train", 0, stop).rooms
    assert len(rooms) == stop
    some = [0, 19, *range(stop - 12, stop)]
    assert [rooms[k] for k in some] == [design_room("balcony", "train", 0, k).room for k in some]


def test_a_worker_leaves_ctrl_c_to_its_parent(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where a thread designs, which cannot ignore signals as it begins the workers."""
    one, me = design_room("tatami", "train", 0, 0), os.getpid()

    def hurt(*_: object) -> Design:
        assert os.getpid() != me
        signal.raise_signal(signal.SIGINT)
        return one

    monkeypatch.setattr(generator, "design_room", hurt)
    with ThreadPoolExecutor(1) as thread:
        designing = thread.submit(design_rooms, "tatami", "train", 0, generator.FEW + 1)
        assert designing.exception() is None
    assert designing.result().rooms == [one.room] * (generator.FEW + 1)


def test_a_bar_is_shown_where_rooms_are_designed_and_a_terminal_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(generator, "design_room", lambda *about: (time.sleep(0.4), design_room(*about))[1])

    def shown(seed: int, terminal: bool) -> str:
        file = io.StringIO()
        file.isatty = lambda: terminal  # type: ignore[method-assign]
        monkeypatch.setattr(sys, "stderr", file)
        designer_cache.read(tmp_path, "tatami", "train", seed, 4)
        return file.getvalue()

    bar = shown(seed=0, terminal=True)
    assert "tatami" in bar
    assert "4/4" in bar
    assert shown(seed=0, terminal=True) == ""  # read
    assert shown(seed=1, terminal=False) == ""


def test_two_that_design_the_same_rooms_at_once_get_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    meet, replace_ = threading.Barrier(3, timeout=20), Path.replace
    monkeypatch.setattr(Path, "replace", lambda *paths: (meet.wait(), replace_(*paths)))
    monkeypatch.setattr(designer_cache, "BLOCK", 3)
    with ThreadPoolExecutor(3) as pool:
        results = list(pool.map(lambda _: designer_cache.read(tmp_path, "tatami", "train", 0, 20), range(3)))
    expected = design_rooms("tatami", "train", 0, 20)
    assert all(same(result, expected) for result in [*results, designer_cache.read(tmp_path, "tatami", "train", 0, 20)])
    assert len(list(tmp_path.iterdir())) == 7


def test_a_changed_rule_never_reads_old_rooms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = designer_cache.rules_hash()
    shutil.copytree(rules.__path__[0], tmp_path / "changed")
    monkeypatch.setattr(rules, "__path__", [str(tmp_path / "changed")])
    designer_cache.rules_hash.cache_clear()
    assert designer_cache.rules_hash() == before
    file = tmp_path / "changed" / "bedroom.py"
    file.write_text(file.read_text().replace("front=60", "front=65", 1))
    designer_cache.rules_hash.cache_clear()
    assert designer_cache.rules_hash() != before


def test_a_changed_clearance_never_meets_old_rooms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = designer_cache.rules_hash()
    file = tmp_path / "clearances.py"
    file.write_text(Path(clearances.__file__).read_text().replace("PASSAGE = 0.6", "PASSAGE = 0.7"))
    monkeypatch.setattr(clearances, "__file__", str(file))
    designer_cache.rules_hash.cache_clear()
    assert designer_cache.rules_hash() != before


def replaced(make: Callable[[Path], object]) -> Callable[[Path], object]:
    return lambda file: (file.unlink(), make(file))


@pytest.mark.parametrize(
    "broken",
    [
        lambda file: file.write_bytes(b""),
        lambda file: file.write_bytes(b"\x80\x04]"),
        lambda file: file.write_bytes(file.read_bytes()[:-1]),
        lambda file: file.write_bytes(file.read_bytes().replace(b"bed", b"bad", 1)),
        lambda file: file.write_bytes(file.read_bytes() + b" "),
        replaced(os.mkfifo),
        replaced(lambda file: file.symlink_to("/dev/zero")),
        replaced(lambda file: file.symlink_to(file)),
    ],
)
def test_a_broken_cache_file_is_made_anew(
    tmp_path: Path, broken: Callable[[Path], object], designed: list[int]
) -> None:
    whole = designer_cache.read(tmp_path, "bedroom", "train", 0, 3)
    (file,) = tmp_path.iterdir()
    broken(file)
    assert same(designer_cache.read(tmp_path, "bedroom", "train", 0, 3), whole)
    assert len(designed) == 6
    assert same(designer_cache.read(tmp_path, "bedroom", "train", 0, 3), whole)
    assert len(designed) == 6
    assert list(tmp_path.iterdir()) == [file]


def planted(file: Path, content: bytes) -> None:
    """As if the cache had written it."""
    digest = hashlib.sha256(file.name.encode() + b"\n" + content).hexdigest()
    file.write_bytes(digest.encode() + b"\n" + content)


def test_a_planted_cache_file_of_no_rooms_is_made_anew(tmp_path: Path, designed: list[int]) -> None:
    whole = designer_cache.read(tmp_path, "bedroom", "train", 0, 3)
    (file,) = tmp_path.iterdir()
    document = file.read_bytes().partition(b"\n")[2]
    planted(file, document)
    assert same(designer_cache.read(tmp_path, "bedroom", "train", 0, 3), whole)
    assert len(designed) == 3  # it is what the cache would have written
    rooms, made, rejected, numbers = json.loads(document)
    room = rooms[0]
    shifted = [room[0], 2, [room[1] + room[2][0] - 2, *room[2][1:]], *room[3:]]
    template, _ = made.popitem()
    designer_cache.read(tmp_path, "bedroom", "train", 0, 2)
    (two,) = tmp_path.glob("*-0-2-*")
    for content in (
        two.read_bytes().partition(b"\n")[2],
        document + b" " * designer_cache.LARGEST_FILE,
        b"[" * 10**5,
        b"9" * 10**5,
        [],
        [rooms[:2], made, rejected, numbers],
        [rooms, made, rejected, numbers[:-12]],
        [rooms, made, rejected, numbers + "AAAAAAAAAAA="],
        [rooms, made, rejected, "/" * 16 + numbers[16:]],  # no numbers
        [[[room[0], 10**18, *room[2:]], *rooms[1:]], made, rejected, numbers],
        [[["\x1b[2J", *room[1:]], *rooms[1:]], made, rejected, numbers],
        [[["\ud800", *room[1:]], *rooms[1:]], made, rejected, numbers],
        [[shifted, *rooms[1:]], made, rejected, numbers],
        [[[7, *room[1:]], *rooms[1:]], made, rejected, numbers],
        [[[*room[:-1], 99], *rooms[1:]], made, rejected, numbers],
        [[[*room[:-1], None], *rooms[1:]], made, rejected, numbers],
        [rooms, {template: 0}, rejected, numbers],
        [rooms, {template: "3"}, rejected, numbers],
        [rooms, made, [[template, 5, 1]], numbers],
        [rooms, made, [[template, [], 1]], numbers],
    ):
        planted(file, content if isinstance(content, bytes) else json.dumps(content).encode())
        designed.clear()
        assert same(designer_cache.read(tmp_path, "bedroom", "train", 0, 3), whole)
        assert len(designed) == 3, content


def test_a_folder_that_cannot_be_written_costs_a_line_and_no_rooms(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(designer_cache, "BLOCK", 2)
    (tmp_path / "file").write_text("in the way")
    assert len(designer_cache.read(tmp_path / "file", "bedroom", "train", 0, 5).rooms) == 5
    said = capsys.readouterr()
    assert not said.out, "where `place out=-` writes rooms"
    assert said.err.count("not kept") == 1


def test_a_file_that_cannot_be_finished_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    assert len(designer_cache.read(tmp_path, "bedroom", "train", 0, 3).rooms) == 3
    assert "No space left" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_cache_lies_where_the_user_keeps_caches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    designer_cache.read(None, "bedroom", "train", 0, 2)
    assert len(list((tmp_path / "layoutrl").iterdir())) == 1
