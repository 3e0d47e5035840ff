"""Whatever stands in a file, its reader answers with a room or with the project's own error, soon and in little memory.

The short form is part of every run of the tests; `pytest -m slow tests/test_fuzz.py` reads 38,000 files.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import pickle
import random
import re
import shutil
import signal
import sys
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from omegaconf import OmegaConf

import layoutrl
from layoutrl import InputError
from layoutrl.rivals.budgets import updates_budget
from layoutrl.rivals.rooms.baselines import random_layout
from layoutrl.rivals.rooms.relations import mine
from layoutrl.rivals.rooms.search import search
from layoutrl.rooms.brief import missing, with_poses
from layoutrl.rooms.categories import names_of
from layoutrl.rooms.designer import generator
from layoutrl.rooms.designer.generator import Designs, design_rooms
from layoutrl.rooms.documents import parsed, room_from_dict, room_to_dict
from layoutrl.rooms.faults import faults
from layoutrl.rooms.room import MAIN_ITEM, Room, RoomError
from layoutrl.rooms.sources import designer_cache, designer_rooms, floorplans, front3d, procthor
from layoutrl.rooms.sources.sweethome3d import read_home
from layoutrl.runs.checked_brief import checked_brief
from layoutrl.runs.checkpoints import load_checkpoint, save_checkpoint
from layoutrl.runs.config import TrainConfig, composed, narrowed
from layoutrl.runs.folder import load_config
from tests.builders import random_room
from tests.rooms.sources import test_front3d, test_procthor
from tests.rooms.sources.test_sweethome3d import home_file

resource = pytest.importorskip("resource", reason="time and memory are watched as POSIX has it")
DATA = Path(__file__).parents[2] / "shared" / "data"
SEARCHING = composed("place", "rooms=some.jsonl").search
SECONDS = 2.0  # of the processor, that an input may take
MAXRSS = 1 if sys.platform == "darwin" else 1024  # bytes, the unit of ru_maxrss
BYTES = 2**30  # that all of them may take, beyond what was taken before
ODD_NUMBERS = (
    math.nan, math.inf, -math.inf, 0, -0.0, -1, 1e-300, 1e-9, 1e300, 10**400, 2**63, 999.9, 1001, 0.1 + 0.2, True,
)  # fmt: skip
ODD_VALUES = (None, "", "x", "\u0000", "ä" * 5000, [], {}, [[]], [None], {"x": 1}, "bed", "1.0")


def times(few: int, many: int) -> Any:
    """How often: few in every run of the tests, many in the slow one."""
    return pytest.mark.parametrize("count", [few, pytest.param(many, marks=pytest.mark.slow)])


@contextmanager
def soon() -> Iterator[None]:
    """Raises TimeoutError after two seconds of this process, whatever else runs on the machine."""

    def late(*_: Any) -> None:
        raise TimeoutError(f"took over {SECONDS} s")

    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


@pytest.fixture(autouse=True)
def little_memory() -> Iterator[None]:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    assert MAXRSS * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) < BYTES


def answered(reader: Callable[[], Any], errors: type[Exception], about: Any) -> Any:
    """What a reader returns, or None for an error of the project's own; anything else fails, and says for what."""
    try:
        with soon():
            return reader()
    except errors:
        return None
    except BaseException as error:
        error.add_note(f"for {about!r:.2000}")
        raise


# Documents -----------------------------------------------------------------------------------------------------------


def places(document: Any) -> Iterator[tuple[Any, Any]]:
    """Every (container, key) of a document."""
    entries = document.items() if isinstance(document, dict) else enumerate(document)
    for key, value in list(entries):
        yield document, key
        if isinstance(value, dict | list):
            yield from places(value)


def mutated_document(document: Any, dice: random.Random) -> Any:
    """A document with some of its values changed, dropped, swapped, nested or repeated."""
    for _ in range(dice.choice((1, 1, 1, 2, 5))):
        found = list(places(document))
        if not found:
            return document
        container, key = dice.choice(found)
        value = container[key]
        kind = dice.randrange(8)
        if kind == 0:
            container[key] = dice.choice(ODD_NUMBERS)
        elif kind == 1:
            container[key] = dice.choice(ODD_VALUES)
        elif kind == 2:
            del container[key]
        elif kind == 3 and isinstance(value, list):
            dice.shuffle(value)  # an outline that crosses itself
        elif kind == 3 and isinstance(value, int | float) and not isinstance(value, bool):
            container[key] = value * dice.choice((-1, 1000, 1e-6, 1 + 1e-12, 10.0 ** dice.randrange(-300, 300)))
        elif kind == 4:
            nested: Any = value
            for _ in range(dice.choice((1, 3, 200))):
                nested = [nested]
            container[key] = nested
        elif kind == 5 and isinstance(value, list):
            container[key] = value * dice.choice((2, 3, 50))
        elif kind == 6:
            other, its_key = dice.choice(found)
            container[key] = json.loads(json.dumps(other[its_key]))  # a copy: no document holds itself
        elif isinstance(container, dict):
            container["x" if dice.random() < 0.5 else "target"] = value
    return document


def mutated_bytes(content: bytes, dice: random.Random) -> bytes:
    """Bytes with some flipped, cut, repeated or in another encoding."""
    changed = bytearray(content)
    for _ in range(dice.choice((1, 1, 3, 20))):
        at = dice.randrange(len(changed) + 1)
        kind = dice.randrange(5)
        if kind == 0 and changed:
            changed[at % len(changed)] = dice.randrange(256)
        elif kind == 1:
            del changed[at:]
        elif kind == 2:
            changed[at:at] = dice.choice(
                (b"{", b"}", b"[", b'"', b"\x00", b"\xff\xfe", b"9" * 5000, b"[" * 100_000, b"\t", b"\n")
            )
        elif kind == 3:
            length = dice.randrange(1, 100)
            changed[at:at] = changed[at : at + length]
        else:
            del changed[at : at + dice.randrange(1, 30)]
    if dice.random() < 0.02:
        return (
            bytes(changed)
            .decode("utf-8", "replace")
            .encode(dice.choice(("utf-16", "utf-32", "latin-1", "utf-7")), "replace")
        )
    return bytes(changed)


def as_json(document: Any, dice: random.Random) -> bytes:
    text = json.dumps(document)
    if dice.random() < 0.05:  # a key that stands there twice
        text = text.replace('"outline":', '"outline": [], "outline":', 1)
    return text.encode()


@pytest.fixture(scope="module")
def documents() -> list[dict[str, Any]]:
    rooms = [room for room_type in MAIN_ITEM for room in design_rooms(room_type, "train", 0, 2).rooms]
    rooms += [random_room(np.random.default_rng(seed)) for seed in range(10)]
    return [room_to_dict(room) for room in rooms]


def room_of_text(text: str | bytes) -> Room:
    """What files are read by, a room at a time."""
    document = parsed(text)
    if isinstance(document, RoomError):
        raise document
    return room_from_dict(document)


@times(400, 12_000)
def test_a_room_of_json_is_a_room_or_an_error_of_its_own(count, documents):
    dice, read = random.Random(count), 0
    for _ in range(count):
        text = json.dumps(dice.choice(documents))
        content = (
            as_json(mutated_document(json.loads(text), dice), dice)
            if dice.random() < 0.7
            else mutated_bytes(text.encode(), dice)
        )
        room = answered(lambda content=content: room_of_text(content), RoomError, content)
        if room is not None:
            read += 1
            assert isinstance(room, Room)
            answered(lambda room=room: (room.indoor, room.envelope), RoomError, content)
    assert 0.02 * count < read < 0.6 * count  # some changes are none, most are


@times(60, 3_000)
def test_a_brief_is_furnished_as_far_as_it_goes(count, documents):
    """What is read is held against what can be furnished, furnished by chance and by search, and its faults found."""
    dice, read = random.Random(count), 0
    known = {item["category"] for document in documents for item in document["furniture"]}
    relations = mine(design_rooms("bedroom", "train", 0, 10).rooms)
    for _ in range(count):
        document = json.loads(json.dumps(dice.choice(documents)))
        for item in document["furniture"]:
            if dice.random() < 0.7:
                del item["center"], item["rotation"]
        content = json.dumps(mutated_document(document, dice))
        room = answered(lambda content=content: room_of_text(content), RoomError, content)
        if room is not None:
            read += 1
            checked = answered(lambda room=room: checked_brief(room, known), (), content)
            rng = np.random.default_rng(0)
            for furnish in (
                lambda brief, rng=rng: random_layout(brief, rng),
                lambda brief, rng=rng: search(brief, relations, SEARCHING, updates_budget(1), rng),
            ):
                layout = answered(
                    lambda checked=checked, furnish=furnish: checked.merge(furnish(checked.brief)), (), content
                )
                answered(lambda layout=layout: faults(layout), (), content)
    assert read > 0.02 * count


@pytest.mark.parametrize("corners", [1_000, 100_000])
def test_an_outline_of_very_many_corners_is_answered(corners, documents):
    angle = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    for radius in (2 + 0 * angle, 2 + np.cos(40 * angle) / 4, np.where(np.arange(corners) % 2, 2, 2.5)):
        outline = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]).tolist()
        document = documents[0] | {"outline": outline, "doors": [], "windows": [], "walls": [], "furniture": []}
        answered(lambda document=document: room_of_text(json.dumps(document)), RoomError, corners)


def test_brackets_and_numbers_without_end_are_answered():
    for text in ("[" * 10**6, '{"a":' * 10**5, "9" * 10**6, '"' + "x" * 10**7, "-" * 10**6, "[" + "1," * 10**6):
        with pytest.raises(RoomError):
            answered(lambda text=text: room_of_text(text), (), text[:100])


@pytest.mark.parametrize("text", ['{"id": "a", "id": "b"}', '{"outline": [], "outline": []}'])
def test_a_key_that_stands_twice_is_refused(text):
    with pytest.raises(RoomError, match="stands there twice"):
        room_of_text(text)


# Real sources --------------------------------------------------------------------------------------------------------


@pytest.mark.skipif(not (DATA / "floorplans").is_dir(), reason="no real plans in ../shared/data/floorplans")
@times(30, 4_000)
def test_a_floor_plan_is_rooms_or_is_left_out(count, tmp_path):
    dice, read = random.Random(count), 0
    plans = sorted((DATA / "floorplans" / floorplans.PLANS).rglob("*.txt"))
    (tmp_path / floorplans.NEAR_COPIES).write_text("a\tb\tcosine\n")
    file = tmp_path / floorplans.PLANS / "aa" / "0001.txt"
    file.parent.mkdir(parents=True)
    for _ in range(count):
        content = dice.choice(plans).read_bytes()
        if dice.random() < 0.7:
            rows = [row.split(b"\t") for row in content.splitlines()]
            for _ in range(dice.choice((1, 2, 10))):
                row = dice.choice(rows)
                odd = dice.choice(
                    (b"nan", b"inf", b"-1e308", b"0", b"1e9", b"", b"wall", b"999999999999", row[0], b"-5")
                )
                row[dice.randrange(len(row))] = odd
            content = b"\n".join(b"\t".join(row) for row in rows)
        else:
            content = mutated_bytes(content, dice)
        file.write_bytes(content)
        room_type, labels = dice.choice(("bathroom", "kitchen")), dice.choice(("snapped", "raw"))
        found = answered(lambda r=room_type, b=labels: floorplans.read(tmp_path, r, b), InputError, content)
        read += bool(found and found.rooms)
    assert 0 < read < count


@pytest.mark.skipif(not (DATA / "designer_rooms").is_dir(), reason="no real rooms in ../shared/data/designer_rooms")
@times(60, 4_000)
def test_a_designers_layout_is_a_room_or_is_left_out(count, tmp_path):
    dice, read = random.Random(count), 0
    real = {kind: sorted((DATA / "designer_rooms").glob(pattern)) for kind, pattern in designer_rooms.FILES.items()}
    for _ in range(count):
        room_type = dice.choice(list(real))
        source = dice.choice(real[room_type])
        file = tmp_path / source.relative_to(DATA / "designer_rooms")
        file.parent.mkdir(parents=True, exist_ok=True)
        content = source.read_bytes()
        if dice.random() < 0.7:
            decoded = json.JSONDecoder().raw_decode(content.decode("utf-8-sig").strip())[0]
            file.write_bytes(as_json(mutated_document(decoded, dice), dice))
        else:
            file.write_bytes(mutated_bytes(content, dice))
        found = answered(lambda r=room_type: designer_rooms.read(tmp_path, r), InputError, file.read_bytes())
        read += bool(found and found.rooms)
        file.unlink()
    assert 0.02 * count < read < 0.95 * count


# Files that other programs write --------------------------------------------------------------------------------------


@times(60, 3_000)
def test_a_home_is_rooms_or_an_error_of_its_own(count, tmp_path):
    """What is read is also written: a broken home never makes writing fail either."""
    dice, whole = random.Random(count), home_file(tmp_path / "whole.sh3d")
    with zipfile.ZipFile(whole) as archive:
        xml = archive.read("Home.xml")
    path, out, read = tmp_path / "home.sh3d", tmp_path / "out.sh3d", 0
    numbers = re.compile(rb"(?<=')-?[\d.]+(?=')")
    for _ in range(count):
        kind = dice.random()
        if kind < 0.3:
            path.write_bytes(mutated_bytes(whole.read_bytes(), dice))
        else:
            odd = str(dice.choice(ODD_NUMBERS))[:400].encode()
            places = list(numbers.finditer(xml))
            place = dice.choice(places)
            broken = mutated_bytes(xml, dice) if kind < 0.6 else xml[: place.start()] + odd + xml[place.end() :]
            with zipfile.ZipFile(path, "w") as archive:
                archive.writestr("Home.xml", broken)
                archive.writestr("0", b"a model")
        content = path.read_bytes()
        home = answered(lambda: read_home(path, move="all"), InputError, content)
        if home is not None:
            read += 1
            layouts = [with_poses(room, dict.fromkeys(missing(room), ((1.0, -1.0), 90.0))) for room in home.rooms]
            answered(lambda home=home, layouts=layouts: home.write(layouts, out), InputError, content)
            out.unlink(missing_ok=True)
    assert 0.1 * count < read < 0.9 * count


@times(60, 3_000)
@pytest.mark.parametrize("source", ["procthor", "front3d"])
def test_a_house_is_rooms_or_is_left_out(source, count, tmp_path):
    dice, read = random.Random(count), {"procthor": procthor.read, "front3d": front3d.read}[source]
    module, name = {"procthor": (test_procthor, "houses.jsonl"), "front3d": (test_front3d, "house.json")}[source]
    file = module.write(tmp_path, module.house(), name=name)
    whole, kept = json.dumps(module.house()), 0
    for _ in range(count):
        if dice.random() < 0.7:
            file.write_bytes(json.dumps(mutated_document(json.loads(whole), dice)).encode())
        else:
            file.write_bytes(mutated_bytes(whole.encode(), dice))
        collection = answered(lambda: read(tmp_path, names_of()), InputError, file.read_bytes())
        kept += bool(collection and collection.rooms)
        answered(lambda collection=collection: str(collection), (), file.read_bytes())
    assert 0.1 * count < kept < count


def test_bombs_and_entities_are_answered(tmp_path):
    path = tmp_path / "home.sh3d"
    laughs = "".join(f"<!ENTITY a{k + 1} '{f'&a{k};' * 10}'>" for k in range(9))
    for xml in (
        "<home>" + " " * 2**27 + "</home>",
        "<home>" + "<a/>" * 2**21 + "</home>",
        "<a>" * 10**6,
        f"<!DOCTYPE home [<!ENTITY a0 'ha'>{laughs}]><home>&a9;</home>",
        "<home name='" + "x" * 2**23 + "'/>",
    ):
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("Home.xml", xml)
        with pytest.raises(InputError):
            answered(lambda: read_home(path), (), xml[:100])


# The cache of designed rooms -----------------------------------------------------------------------------------------


@times(300, 4_000)
def test_a_cached_file_is_the_rooms_or_is_made_anew(count, tmp_path, monkeypatch):
    dice = random.Random(count)
    whole = designer_cache.read(tmp_path, "bedroom", "train", 0, 6)
    monkeypatch.setattr(generator, "_one", lambda *about: Designs([whole.rooms[about[-1]]]))
    anew = Designs(whole.rooms)
    (file,) = tmp_path.iterdir()
    content = file.read_bytes()
    document, read = content.partition(b"\n")[2], 0
    for _ in range(count):
        kind = dice.random()
        if kind < 0.4:
            broken = mutated_bytes(content, dice)
        else:
            changed = (
                mutated_bytes(document, dice)
                if kind < 0.6
                else json.dumps(mutated_document(json.loads(document), dice)).encode()
            )
            broken = hashlib.sha256(file.name.encode() + b"\n" + changed).hexdigest().encode() + b"\n" + changed
        file.write_bytes(broken)
        designs = answered(lambda: designer_cache.read(tmp_path, "bedroom", "train", 0, 6), (), broken)
        if kind < 0.4:
            assert designs in (whole, anew)
        elif designs != anew:  # a file that somebody who can write there made up: rooms all the same
            read += 1
            assert len(designs.rooms) == 6
            answered(lambda designs=designs: [str(designs), repr(designs)], (), broken)
            answered(lambda designs=designs: [(r.indoor, r.moving.footprint) for r in designs.rooms], (), broken)
    assert 0.01 * count < read < 0.6 * count


def test_a_planted_cache_file_never_runs_code(tmp_path):
    whole = designer_cache.read(tmp_path, "bedroom", "train", 0, 6)
    (file,) = tmp_path.iterdir()
    for name in (file, file.with_suffix(".pickle")):  # which earlier versions read
        content = pickle.dumps(Evil(tmp_path / "made"))
        for planted in (
            content,
            hashlib.sha256(name.name.encode() + b"\n" + content).hexdigest().encode() + b"\n" + content,
        ):
            name.write_bytes(planted)
            assert designer_cache.read(tmp_path, "bedroom", "train", 0, 6) == whole
    assert not (tmp_path / "made").exists()


# Runs ----------------------------------------------------------------------------------------------------------------


@times(50, 1_000)
def test_a_checkpoint_is_a_state_or_an_error_of_its_own(count, tmp_path, capsys):
    dice, read = random.Random(count), 0
    state = {
        "version": layoutrl.__version__,
        "config": {},
        "rooms": "",
        "seconds": 1.0,
        "training": {"weights": torch.ones(50), "updates": 3},
        "categories": ["a"],
    }
    save_checkpoint(tmp_path, state, 3)
    file = tmp_path / "checkpoints" / "00000003.pt"
    whole, mark = file.read_bytes(), json.loads(file.with_suffix(".json").read_text())
    for _ in range(count):
        content = mutated_bytes(whole, dice)
        file.write_bytes(content)
        honest = json.dumps(mark | {"sha256": hashlib.sha256(content).hexdigest()}).encode()
        file.with_suffix(".json").write_bytes(honest if dice.random() < 0.8 else mutated_bytes(honest, dice))
        read += answered(lambda: load_checkpoint(tmp_path, torch.device("cpu")), InputError, content) is not None
    assert 0 < read < count
    capsys.readouterr()


class Evil:
    """What makes a folder when it is unpickled."""

    def __init__(self, folder: Path):
        self.folder = folder

    def __reduce__(self) -> Any:
        return os.mkdir, (str(self.folder),)


def test_a_loaded_checkpoint_never_runs_code(tmp_path, capsys):
    made = tmp_path / "made"
    for content in (pickle.dumps(Evil(made), protocol=2), None):
        folder = tmp_path / str(content is None)
        folder.mkdir()
        save_checkpoint(folder, {"version": layoutrl.__version__, "evil": Evil(made)}, 1)
        if content is not None:
            file = folder / "checkpoints" / "00000001.pt"
            file.write_bytes(content)
            mark = json.loads(file.with_suffix(".json").read_text())
            file.with_suffix(".json").write_text(json.dumps(mark | {"sha256": hashlib.sha256(content).hexdigest()}))
        with pytest.raises(InputError, match="no whole checkpoint"):
            load_checkpoint(folder, torch.device("cpu"))
        said = capsys.readouterr().err
        assert "it holds other things than tensors and plain values" in said
        assert "weights_only" not in said  # torch's advice would run it
    assert not made.exists()
    pickle.loads(pickle.dumps(Evil(made)))
    assert made.exists()  # it would have been


@times(50, 1_000)
def test_a_configuration_is_one_or_an_error_of_its_own(count, tmp_path):
    dice, read = random.Random(count), 0
    whole = OmegaConf.to_yaml(OmegaConf.structured(narrowed(composed("train", "room=kitchen"), TrainConfig))).encode()
    digits = [at for at, byte in enumerate(whole) if chr(byte).isdigit()]
    for _ in range(count):
        another = bytearray(whole)
        another[dice.choice(digits)] = dice.choice(b"0123456789")  # few that are broken otherwise can be read
        for content in (mutated_bytes(whole, dice), bytes(another)):
            (tmp_path / "config.yaml").write_bytes(content)
            read += answered(lambda: load_config(tmp_path, TrainConfig), InputError, content) is not None
    assert 0 < read < 2 * count
    shutil.rmtree(tmp_path)
