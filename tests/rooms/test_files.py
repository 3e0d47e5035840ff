from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutrl import InputError
from layoutrl.rooms.documents import room_to_dict, with_layout
from layoutrl.rooms.files import read_rooms, write_rooms
from layoutrl.rooms.room import Room
from layoutrl.rooms.units import unit_line, unit_of
from tests.builders import opening, rectangular_room, rooms
from tests.rooms.test_documents import document, polygons

Change = Callable[[dict[str, Any]], object]


def write(path: Path, *lines: str | dict[str, Any]) -> Path:
    path.write_text("\n".join(line if isinstance(line, str) else json.dumps(line) for line in lines), encoding="utf-8")
    return path


# round trips


@given(st.lists(rooms(), max_size=3, unique_by=lambda room: room.id), st.sampled_from(["jsonl", "json", "JSON"]))
def test_written_rooms_are_read_back_equal(
    tmp_path_factory: pytest.TempPathFactory, written: list[Room], suffix: str
) -> None:
    path = tmp_path_factory.mktemp("rooms") / f"rooms.{suffix}"
    write_rooms(path, written)
    collection = read_rooms(path, strict=True)
    assert collection.rooms == written
    assert collection.left_out == []


def test_rooms_of_one_id_are_not_written_as_only_one_could_be_read(tmp_path: Path) -> None:
    room = rectangular_room(4, 3)
    with pytest.raises(InputError, match=f"^rooms: '{room.id}' is the id of several"):
        write_rooms(tmp_path / "rooms.json", [room, room])
    assert not (tmp_path / "rooms.json").exists()


def test_a_json_file_holds_one_room_and_a_folder_is_read_in_order_of_names(tmp_path: Path) -> None:
    write(tmp_path / "b.json", json.dumps(document(id="second"), indent=2))
    (tmp_path / "c").mkdir()
    write(tmp_path / "c" / "d.jsonl", document(id="third"), "", document(id="fourth"))
    write(tmp_path / "a.jsonl", document(id="first"))
    write(tmp_path / "notes.txt", "not a room")
    collection = read_rooms(tmp_path)
    assert [room.id for room in collection.rooms] == ["first", "second", "third", "fourth"]
    assert collection.left_out == []


@pytest.mark.parametrize("where", ["room", "item", "field of the user's own"])
def test_a_key_that_is_there_twice_costs_one_room_of_a_list(tmp_path: Path, where: str) -> None:
    first, broken, third = (json.dumps(document(id=name)) for name in ("first", "broken", "third"))
    broken = {
        "room": broken.replace("{", '{"id": "other", ', 1),
        "item": broken.replace('"category"', '"size": [1, 1], "category"', 1),
        "field of the user's own": broken.replace("{", '{"x_mine": {"a": 1, "a": 2}, ', 1),
    }[where]
    file = tmp_path / "rooms.json"
    file.write_text(f"[{first}, {broken}, {third}]")
    collection = read_rooms(file)
    assert [room.id for room in collection.rooms] == ["first", "third"]
    ((place, message),) = collection.left_out
    assert place == f"{file}[1]"
    key = {"room": "id", "item": "size", "field of the user's own": "a"}[where]
    assert message == f"room 'broken': {key}: stands there twice; expected once"


@pytest.mark.parametrize(("name", "text"), [("x.jsonl", '[{"a": 1, "a": 2}]'), ("x.json", '[[{"a": 1, "a": 2}]]')])
def test_a_list_in_place_of_a_room_is_answered_whatever_it_holds(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    ((_, message),) = read_rooms(tmp_path / name).left_out
    assert "a: stands there twice" in message


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf \n"])
def test_a_json_file_may_hold_a_list_of_rooms(tmp_path: Path, mark: bytes) -> None:
    entries = [document(id="first"), {"id": "broken"}, document(id="third"), 7]
    file = tmp_path / "rooms.json"
    file.write_bytes(mark + json.dumps(entries, indent=2).encode())
    collection = read_rooms(file)
    assert [room.id for room in collection.rooms] == ["first", "third"]
    assert [where for where, _ in collection.left_out] == [f"{file}[1]", f"{file}[3]"]
    assert collection.left_out[0][1].startswith("room 'broken': ")
    file.write_text("[]")
    assert read_rooms(file).rooms == []
    file.write_text(json.dumps(entries)[:-20])
    ((where, _),) = read_rooms(file).left_out
    assert where == f"{file}:1"


# what is mended


def test_a_byte_order_mark_and_blank_lines_are_no_fault(tmp_path: Path) -> None:
    path = tmp_path / "rooms.jsonl"
    path.write_bytes(b"\xef\xbb\xbf" + json.dumps(document()).encode() + b"\r\n\r\n  \r\n")
    assert [room.id for room in read_rooms(path, strict=True).rooms] == ["b-17"]


# what is refused: (change to a good room, field that must be named, a word of what is expected)


def put(field: str, value: Any) -> Change:
    return lambda room: room.__setitem__(field, value)


def put_item(field: str, value: Any, k: int = 0) -> Change:
    return lambda room: room["furniture"][k].__setitem__(field, value)


def drop(field: str) -> Change:
    return lambda room: room.pop(field)


def drop_item(field: str) -> Change:
    return lambda room: room["furniture"][0].pop(field)


BOWTIE = [[0, 0], [4, 3], [4, 0], [0, 3]]
NAN, INFINITY = float("nan"), float("inf")
FAULTS: dict[str, tuple[Change, str, str]] = {
    "outline crosses itself": (put("outline", BOWTIE), "outline", "simple polygon"),
    "outline crosses itself here": (put("outline", [[0, 0], [4, 0], [0, 3], [4, 3]]), "outline", "meet at [2, 1.5]"),
    "outline in capitals": (
        lambda room: room.__setitem__("Outline", room.pop("outline")),
        "outline",
        "in metres; got 'Outline', which is no field",
    ),
    "item with a type": (
        lambda room: room["furniture"][0].__setitem__("type", room["furniture"][0].pop("category")),
        "furniture[0].category",
        "missing; expected a name, as bed; got 'type', which is no field",
    ),
    "outline of two corners": (put("outline", [[0, 0], [4, 0], [0, 0]]), "outline", "three different corners"),
    "outline without area": (put("outline", [[0, 0], [2, 0], [4, 0]]), "outline", "expected a"),
    "outline is no list": (put("outline", "4x3"), "outline", "list"),
    "corner of three numbers": (put("outline", [[0, 0], [4, 0, 1], [4, 3]]), "outline[1]", "two numbers"),
    "corner NaN": (put("outline", [[0, 0], [4, NAN], [4, 3]]), "outline[1]", "finite number"),
    "hole outside": (put("holes", [[[5, 1], [6, 1], [6, 2]]]), "holes[0]", "inside the outline"),
    "hole along the outline": (put("holes", [[[0, 1], [1, 1], [1, 2], [0, 2]]]), "holes", "touch along a side"),
    "hole crosses itself": (put("holes", [[[1, 1], [2, 2], [2, 1], [1, 2]]]), "holes[0]", "simple polygon"),
    "walls misspelt": (put("walls", [[[0, 0], [1, 0], [1, 1]]]), "walls[0]", "JSON object"),
    "wall crosses itself": (put("walls", polygons(BOWTIE)), "walls[0].polygon", "simple polygon"),
    "door far outside": (put("doors", polygons([[9, 9], [10, 9], [10, 9.2]])), "doors[0]", "in the walls"),
    "second door inside": (
        lambda room: room["doors"].append({"polygon": [[1, 0], [2, 0], [2, 0.2], [1, 0.2]]}),
        "doors[1]",
        "inside the room",
    ),
    "window in mid room": (put("windows", polygons([[1, 1], [2, 1], [2, 1.2]])), "windows[0]", "in the walls"),
    "door without polygon": (put("doors", [{}]), "doors[0].polygon", "missing"),
    "door with polygons": (
        lambda room: room["doors"][0].__setitem__("polygons", []),
        "doors[0].polygons",
        "unknown field; expected polygon",
    ),
    "doors are one object": (put("doors", {"polygon": []}), "doors", "list"),
    "size zero": (put_item("size", [0, 1.5]), "furniture[0].size", "above zero"),
    "size negative": (put_item("size", [2, -1.5]), "furniture[0].size", "above zero"),
    "size NaN": (put_item("size", [2, NAN]), "furniture[0].size", "finite"),
    "size infinite": (put_item("size", [INFINITY, 2]), "furniture[0].size", "finite"),
    "size one number": (put_item("size", 2), "furniture[0].size", "two numbers"),
    "size text": (put_item("size", ["2", 1]), "furniture[0].size", "finite number"),
    "size boolean": (put_item("size", [True, 1]), "furniture[0].size", "finite number"),
    "circle with unequal sizes": (put_item("size", [0.5, 0.6], 1), "furniture[1].size", "diameter twice"),
    "tucked of text": (put_item("tucked", "yes"), "furniture[0].tucked", "true or false"),
    "unknown shape": (put_item("shape", "oval"), "furniture[0].shape", "rectangle or circle"),
    "centre of one number": (put_item("center", [1]), "furniture[0].center", "two numbers"),
    "centre as object": (put_item("center", {"x": 1, "y": 1}), "furniture[0].center", "two numbers"),
    "centre of text": (put_item("center", ["1", "1"]), "furniture[0].center", "finite number"),
    "centre infinite": (put_item("center", [1, -INFINITY]), "furniture[0].center", "finite number"),
    "rotation of text": (put_item("rotation", "left"), "furniture[0].rotation", "finite number"),
    "rotation NaN": (put_item("rotation", NAN), "furniture[0].rotation", "finite number"),
    "item outside": (put_item("center", [3.5, 1.5]), "furniture[0].center", "outer walls"),
    "category empty": (put_item("category", " "), "furniture[0].category", "name"),
    "category a number": (put_item("category", 3), "furniture[0].category", "name"),
    "item with a centre": (put_item("centre", [1, 1]), "furniture[0].centre", "unknown field; expected center"),
    "item is a text": (put("furniture", ["bed"]), "furniture[0]", "JSON object"),
    "furniture is null": (put("furniture", None), "furniture", "list"),
    "target too large": (put("target", 2), "target", "0 to 1"),
    "target negative": (put("target", -1), "target", "0 to 1"),
    "target of no furniture": (
        lambda room: room.update(furniture=[], target=0),
        "target",
        "of which there is none; got 0",
    ),
    "target a name": (put("target", "bed"), "target", "index"),
    "target boolean": (put("target", True), "target", "index"),
    "target a fraction": (put("target", 0.0), "target", "index"),
    "unknown room type": (put("room_type", "attic"), "room_type", "bathroom, bedroom"),
    "room type a number": (put("room_type", 1), "room_type", "name"),
    "unknown field": (put("hole", []), "hole", "unknown field; expected holes"),
    "group empty": (put("group", ""), "group", "name"),
    **{f"{name} missing": (drop(name), name, "missing") for name in document() if name != "id"},
    **{f"item's {name} missing": (drop_item(name), f"furniture[0].{name}", "missing") for name in ("category", "size")},
}


@pytest.mark.parametrize("fault", list(FAULTS))
def test_a_room_with_a_fault_is_left_out_in_one_line_and_the_others_are_kept(fault: str, tmp_path: Path) -> None:
    change, field, expected = FAULTS[fault]
    bad = document(id="bad one")
    change(bad)
    path = write(tmp_path / "rooms.jsonl", document(id="before"), bad, document(id="after"))

    collection = read_rooms(path)

    assert [room.id for room in collection.rooms] == ["before", "after"]
    ((where, reason),) = collection.left_out
    assert where == f"{path}:2"
    assert reason.startswith(f"room 'bad one': {field}: ")
    assert expected in reason
    assert "\n" not in reason


@pytest.mark.parametrize("fault", list(FAULTS))
def test_strict_raises_file_line_room_and_field_in_one_line(fault: str, tmp_path: Path) -> None:
    change, field, expected = FAULTS[fault]
    bad = document(id="bad one")
    change(bad)
    path = write(tmp_path / "rooms.jsonl", document(id="before"), "", bad)

    with pytest.raises(InputError) as raised:
        read_rooms(path, strict=True)

    message = str(raised.value)
    assert message.startswith(f"{path}:3: room 'bad one': {field}: ")
    assert expected in message
    assert "\n" not in message


UNREADABLE = {
    "id missing": (json.dumps({k: v for k, v in document().items() if k != "id"}), "id: missing"),
    "id a number": (json.dumps(document(id=5)), "room 5: id: expected a name; got 5"),
    "a list": ("[1, 2]", "room: expected a JSON object; got [1, 2]"),
    "a number": ("5", "room: expected a JSON object; got 5"),
    "null": ("null", "room: expected a JSON object; got null"),
    "no JSON": ("id=b-17", "column 1: expected JSON"),
    "single quotes": ("{'id': 'b-17'}", "column 2: expected JSON"),
    "two rooms in a line": ("{} {}", "column 4: expected JSON"),
    "truncated": (json.dumps(document())[:-40], "line: expected one whole JSON object; the text breaks off"),
}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda text: text.replace('"room_type":', '"room_type"', 1),
            r"line 3, column \d+: expected JSON; Expecting ':'",
        ),
        (lambda text: text[:-4], "file: expected whole JSON; the text breaks off$"),
    ],
)
def test_a_mistake_in_a_file_of_several_lines_is_named_by_its_line(tmp_path: Path, change, said: str) -> None:
    path = tmp_path / "room.json"
    path.write_text(change(json.dumps(document(), indent=1)))
    ((_, reason),) = read_rooms(path).left_out
    assert re.match(said, reason)


def test_only_a_line_that_breaks_off_is_told_which_file_may_have_several_for_a_room(tmp_path: Path) -> None:
    for name, said in (("room.json", "file: expected whole JSON; the text breaks off"), ("room.jsonl", ".json file)")):
        path = write(tmp_path / name, json.dumps(document())[:-40])
        ((_, reason),) = read_rooms(path).left_out
        assert reason.endswith(said)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "file: is empty; expected a room, or a list of them"),
        (" \n", "file: is empty; expected a room, or a list of them"),
        ('{"rooms": []}', "rooms: unknown field; expected a room, or a list of them by itself"),
    ],
)
def test_a_file_that_holds_no_room_is_answered_by_what_it_holds(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "rooms.json").write_text(text)
    assert [reason for _, reason in read_rooms(tmp_path / "rooms.json").left_out] == [said]


@pytest.mark.parametrize("fault", list(UNREADABLE))
def test_a_line_that_is_no_room_is_named_by_file_and_line(fault: str, tmp_path: Path) -> None:
    text, expected = UNREADABLE[fault]
    path = write(tmp_path / "rooms.jsonl", document(), text)
    collection = read_rooms(path)
    assert [room.id for room in collection.rooms] == ["b-17"]
    ((where, reason),) = collection.left_out
    assert where == f"{path}:2"
    assert reason.startswith(expected)
    with pytest.raises(InputError) as raised:
        read_rooms(path, strict=True)
    assert str(raised.value) == f"{path}:2: {reason}"


@given(st.data())
def test_a_last_line_that_breaks_off_anywhere_is_left_out(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    text = json.dumps(document(id="second"))
    end = data.draw(st.integers(1, len(text) - 1))
    path = write(tmp_path_factory.mktemp("rooms") / "rooms.jsonl", document(id="first"), text[:end])
    collection = read_rooms(path)
    assert [room.id for room in collection.rooms] == ["first"]
    assert [where for where, _ in collection.left_out] == [f"{path}:2"]


def test_an_id_that_was_read_before_is_left_out_even_in_another_file(tmp_path: Path) -> None:
    write(tmp_path / "a.jsonl", document(id="one"))
    second = write(tmp_path / "b.jsonl", document(id="two"), document(id="one"))
    collection = read_rooms(tmp_path)
    assert [room.id for room in collection.rooms] == ["one", "two"]
    ((where, reason),) = collection.left_out
    assert where == f"{second}:2"
    assert reason.startswith("room 'one': id: expected a name of its own")
    with pytest.raises(InputError, match=r"b\.jsonl:2: room 'one': id: "):
        read_rooms(tmp_path, strict=True)


def test_the_id_of_a_room_that_was_left_out_may_be_used_again(tmp_path: Path) -> None:
    path = write(tmp_path / "rooms.jsonl", document(room_type="attic"), document())
    assert [room.id for room in read_rooms(path).rooms] == ["b-17"]


def test_a_type_for_rooms_that_say_none_is_one_of_the_eight(tmp_path: Path) -> None:
    path = write(tmp_path / "rooms.jsonl", document())
    with pytest.raises(InputError, match=r"^room_type: expected one of .*; got 'office', which is a study here$"):
        read_rooms(path, room_type="office")


@pytest.mark.parametrize("strict", [False, True])
def test_a_path_without_rooms_is_answered_in_one_line_that_names_it(strict: bool, tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    write(empty / "readme.txt", "no rooms here")
    for path, expected in (
        (tmp_path / "missing.jsonl", "no such file or folder"),
        (empty, "found none"),
    ):
        with pytest.raises(InputError) as raised:
            read_rooms(path, strict)
        assert str(raised.value).startswith(f"{path}: ")
        assert expected in str(raised.value)
        assert "\n" not in str(raised.value)


def test_a_file_that_is_not_utf8_is_left_out_and_the_rest_of_the_folder_read(tmp_path: Path) -> None:
    (tmp_path / "latin.jsonl").write_bytes(json.dumps(document(id="Küche"), ensure_ascii=False).encode("latin-1"))
    write(tmp_path / "good.jsonl", document(id="good"))
    collection = read_rooms(tmp_path)
    assert [room.id for room in collection.rooms] == ["good"]
    ((where, reason),) = collection.left_out
    assert where == f"{tmp_path / 'latin.jsonl'}:1"
    assert "UTF-8" in reason


@pytest.mark.parametrize("digits", [400, 5000])
def test_a_number_of_absurd_length_costs_one_room(digits: int, tmp_path: Path) -> None:
    path = write(tmp_path / "rooms.jsonl", document(id="good"))
    with path.open("a", encoding="utf-8") as file:
        file.write("\n" + json.dumps(document(id="bad")).replace("[4, 0]", f"[{'9' * digits}, 0]") + "\n")
    collection = read_rooms(path)
    assert [room.id for room in collection.rooms] == ["good"]
    assert [where for where, _ in collection.left_out] == [f"{path}:2"]


def test_brackets_without_end_cost_one_room(tmp_path: Path) -> None:
    path = tmp_path / "rooms.jsonl"
    path.write_text(json.dumps(document(id="good")) + "\n" + "[" * 100_000 + "\n")
    assert [room.id for room in read_rooms(path).rooms] == ["good"]


@pytest.mark.parametrize("separator", ["\u2028", "\x85"])
def test_a_line_separator_inside_a_name_does_not_cut_the_line(separator: str, tmp_path: Path) -> None:
    path = tmp_path / "rooms.jsonl"
    path.write_text(json.dumps(document(id=f"a{separator}b"), ensure_ascii=False), encoding="utf-8")
    assert [room.id for room in read_rooms(path).rooms] == [f"a{separator}b"]


# units


def scaled(written: dict[str, Any], by: float) -> dict[str, Any]:
    """A room's document with lengths in another unit, by its fields: written out, unlike the reader's own way."""
    document = json.loads(json.dumps(written))
    for name in ("outline", "holes", "walls", "doors", "windows"):
        text = json.dumps(document.get(name, []))
        document[name] = json.loads(
            text, parse_float=lambda number: float(number) * by, parse_int=lambda n: int(n) * by
        )
    for item in document["furniture"]:
        for name in ("center", "size"):
            item[name] = [length * by for length in item[name]]
    return document


@given(rooms(), st.sampled_from([("cm", 100), ("mm", 1000)]))
def test_centimetres_and_millimetres_are_told_and_said(
    tmp_path_factory: pytest.TempPathFactory, room: Room, unit: tuple[str, int]
) -> None:
    name, by = unit
    path = write(tmp_path_factory.mktemp("rooms") / "rooms.jsonl", scaled(room_to_dict(room), by))
    told, given = read_rooms(path, strict=True), read_rooms(path, strict=True, unit=name)
    assert told.notes == [f"{path}: lengths are read as {name}, as rooms are large (unit=m if they are)"]
    assert str(told).endswith(told.notes[0])
    assert given.notes == []
    for (read,) in (told.rooms, given.rooms):
        assert read.indoor.symmetric_difference(room.indoor).area < 1e-6
        for item, before in zip(read.furniture, room.furniture, strict=True):
            assert (*item.size, *item.center, item.rotation) == pytest.approx(
                (*before.size, *before.center, before.rotation)
            )


@pytest.mark.parametrize(("unit", "metres"), [("in", 0.0254), ("ft", 0.3048)])
def test_inches_and_feet_are_read_and_written_where_they_are_said(unit: str, metres: float, tmp_path: Path) -> None:
    room = rectangular_room(3.6, 4.2, openings=(opening("door", 1.0, -0.2, 1.9, 0.0),))
    written = scaled(room_to_dict(room), 1 / metres)
    (read,) = read_rooms(write(tmp_path / "rooms.jsonl", written), strict=True, unit=unit).rooms
    assert read.indoor.symmetric_difference(room.indoor).area < 1e-6
    (item,) = read.furniture
    assert (*item.size, *item.center) == pytest.approx((1.0, 1.0, 1.8, 2.1))
    asked = replace(read, furniture=(replace(item, center=None),))
    placed = replace(read, furniture=(replace(item, center=(0.5, 0.5)),))
    (entry,) = with_layout(written, asked, placed, (), (), unit)["furniture"]
    assert entry["center"] == pytest.approx([0.5 / metres] * 2, abs=1e-4)


@pytest.mark.parametrize("width", [28, 36, 44, 70, 90])
def test_doors_as_narrow_as_inches_have_it_are_said(width: float) -> None:
    room = rectangular_room(3.6, 4.2, openings=(opening("door", 1.0, -0.2, 1.0 + width / 100, 0.0),))
    documents = [scaled(room_to_dict(room), 100), scaled(room_to_dict(rectangular_room()), 100), {}, None, 3]
    assert unit_of(documents) == "cm"
    line = "lengths are read as cm, as rooms are large (unit=m if they are)"
    narrow = f"; doors are {width} cm wide then (unit=in if lengths are inches)"
    assert unit_line("cm", documents) == line + narrow * (width < 45)
    assert unit_line("mm", documents) == line.replace("cm", "mm")
    assert unit_line("cm", documents[1:]) == line


def test_a_file_that_may_be_in_inches_is_said_to_be_so(tmp_path: Path) -> None:
    room = rectangular_room(3.6, 4.2, openings=(opening("door", 1.0, -0.2, 1.9, 0.0),))
    (note,) = read_rooms(write(tmp_path / "rooms.jsonl", scaled(room_to_dict(room), 1 / 0.0254))).notes
    assert note.endswith("doors are 35 cm wide then (unit=in if lengths are inches)")


@given(rooms())
def test_metres_are_taken_for_metres(tmp_path_factory: pytest.TempPathFactory, room: Room) -> None:
    path = tmp_path_factory.mktemp("rooms") / "rooms.jsonl"
    write_rooms(path, [room])
    collection = read_rooms(path, strict=True)
    assert (collection.rooms, collection.notes) == ([room], [])


def test_a_file_has_one_unit_that_of_most_of_its_rooms(tmp_path: Path) -> None:
    small = {name: [] for name in ("doors", "windows", "furniture")}
    lines = [scaled(document(id=f"room {k}"), 1000) for k in range(3)]
    closet = scaled(document(id="closet", outline=[[0, 0], [1, 0], [1, 1], [0, 1]], **small), 1000)
    collection = read_rooms(write(tmp_path / "rooms.jsonl", *lines, closet), strict=True)
    assert collection.rooms[-1].indoor.area == pytest.approx(1.0)  # alone it is taken for 10 m wide


def test_what_is_wrong_with_a_length_says_in_which_unit_it_was_read(tmp_path: Path) -> None:
    wrong, bare = document(id="wrong"), scaled(document(id="bare"), 100)
    wrong["furniture"][0]["size"] = [-2.1, 1.5]
    del bare["furniture"][0]["size"]
    rooms = scaled(document(), 100), scaled(wrong, 100), bare, scaled(document(), 100)
    (_, said), *others = read_rooms(write(tmp_path / "rooms.jsonl", *rooms)).left_out
    assert said.endswith("in metres; got [-2.1, 1.5] (lengths were read as cm)")
    assert len(others) == 2  # a size that is missing, and an id that is there already
    assert not any("read as" in other for _, other in others)


def test_a_hall_in_metres_is_no_room_in_centimetres(tmp_path: Path) -> None:
    hall = document(outline=[[0, 0], [100, 0], [100, 3], [0, 3]])
    (room,) = read_rooms(write(tmp_path / "rooms.jsonl", hall), strict=True).rooms
    assert room.indoor.area == 300


def test_an_unknown_unit_is_answered(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="unit: expected one of auto, m, cm, mm, in, ft; got inches"):
        read_rooms(write(tmp_path / "rooms.jsonl", document()), unit="inches")
