"""The gallery draws any rooms that there are, those to be furnished, too."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from layoutrl import InputError, gallery
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.documents import room_to_dict
from layoutrl.rooms.room import Room
from layoutrl.runs.config import composed


@pytest.fixture(scope="module")
def mine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bedroom without its bed, and a kitchen with a name in a script that few fonts have."""
    file = tmp_path_factory.mktemp("rooms") / "mine.jsonl"
    bedroom, kitchen = (room_to_dict(design_rooms(kind, "test", 7, 1).rooms[0]) for kind in ("bedroom", "kitchen"))
    del bedroom["furniture"][bedroom["target"]]["center"]
    file.write_text("\n".join(map(json.dumps, (bedroom, kitchen | {"id": "厨房"}))), encoding="utf-8")
    return file


def drawn(mine: Path, tmp_path: Path, *arguments: str) -> str:
    config = composed("gallery", "data=json", f"data.root={mine}", f"out={tmp_path}", *arguments)
    return gallery.run(config)[1].read_text(encoding="utf-8")


def test_rooms_whose_item_is_to_be_placed_are_drawn_and_say_so(mine: Path, tmp_path: Path) -> None:
    assert "to be placed: bed" in drawn(mine, tmp_path)


def test_of_all_types_those_are_drawn_that_a_file_has_in_any_script(mine: Path, tmp_path: Path) -> None:
    svg = drawn(mine, tmp_path, "all_types=true")  # a warning of a missing glyph would be an error here
    assert "to be placed: bed" in svg
    assert "厨房" in svg


@pytest.mark.parametrize("options", [("room=tatami", "room.item=all"), ("all_types=true",)])
def test_as_many_rooms_are_drawn_as_are_asked_for(
    options: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[Room] = []
    sheet = gallery.sheet
    monkeypatch.setattr(gallery, "sheet", lambda rooms: shown.extend(rooms) or sheet(rooms))
    gallery.run(composed("gallery", f"data.root={tmp_path}", f"out={tmp_path}", "rooms=3", *options))
    assert len(shown) == 3


def test_of_a_file_as_many_of_one_type_are_drawn_as_there_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rooms = [*design_rooms("bedroom", "test", 7, 4).rooms, *design_rooms("kitchen", "test", 7, 1).rooms]
    (file := tmp_path / "mine.jsonl").write_text("\n".join(json.dumps(room_to_dict(room)) for room in rooms))
    shown: list[Room] = []
    sheet = gallery.sheet
    monkeypatch.setattr(gallery, "sheet", lambda rooms: shown.extend(rooms) or sheet(rooms))
    drawn(file, tmp_path / "all", "all_types=true", "rooms=8")
    assert [room.id for room in shown] == [room.id for room in rooms]
    assert "are drawn" not in capsys.readouterr().out
    shown.clear()
    drawn(file, tmp_path / "few", "all_types=true", "rooms=3")
    assert [room.room_type for room in shown] == ["bedroom", "bedroom", "kitchen"]  # of all types in turn
    assert "3 of 5 rooms are drawn; rooms=5 draws all" in capsys.readouterr().out


def test_a_sheet_is_overwritten_in_its_own_folder_alone(
    mine: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn(mine, tmp_path)
    with pytest.raises(InputError, match=r"^out: .*/bedroom-json-mine\.png is there already; expected another folder"):
        drawn(mine, tmp_path)
    monkeypatch.chdir(tmp_path)
    config = composed("gallery", "data=json", f"data.root={mine}")
    sheets = [Path(f"gallery/bedroom-json-mine.{kind}") for kind in ("png", "svg")]
    assert gallery.run(config) == gallery.run(config) == sheets


def test_a_type_that_the_file_does_not_have_is_answered(mine: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="json has no study to draw"):
        drawn(mine, tmp_path, "room=study")
