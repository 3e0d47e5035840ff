"""A room as a document: what is read from it, what is refused, and what is written back."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Polygon

from layoutrl.rooms.brief import without_poses
from layoutrl.rooms.documents import parsed, room_from_dict, room_to_dict, with_layout
from layoutrl.rooms.room import MAIN_ITEM, Item, Room, RoomError, wall_band
from tests.builders import rectangle, rectangular_room, rooms


def document(**fields: Any) -> dict[str, Any]:
    """A good room as JSON has it: 4 m by 3 m with a door, a bed and a round stool."""
    return {
        "id": "b-17",
        "room_type": "bedroom",
        "outline": [[0, 0], [4, 0], [4, 3], [0, 3]],
        "doors": [{"polygon": [[1, -0.2], [2, -0.2], [2, 0], [1, 0]]}],
        "windows": [{"polygon": [[1, 3], [2, 3], [2, 3.2], [1, 3.2]]}],
        "furniture": [
            {"category": "bed", "center": [1.0, 1.5], "size": [2.0, 1.5], "rotation": 0},
            {"category": "stool", "shape": "circle", "center": [3, 2], "size": [0.5, 0.5]},
        ],
    } | fields


def polygons(*rings: list[list[float]]) -> list[dict[str, Any]]:
    return [{"polygon": ring} for ring in rings]


def test_a_tucked_chair_survives() -> None:
    chair = Item("chair", (0.45, 0.45), (1.0, 1.5), 90.0, tucked=True)
    assert room_from_dict(json.loads(json.dumps(room_to_dict(rectangular_room(4, 3, chair))))).furniture == (chair,)


@pytest.mark.parametrize("name", ["living_room", "Living room", "LIVING-ROOM", " living  room "])
def test_a_room_type_may_be_written_as_people_write_it(name: str) -> None:
    room = room_from_dict(document(room_type=name, furniture=[], target=None))
    assert room.room_type == "living_room"


@pytest.mark.parametrize("name", ["bedroom", "bed room", "Bed-Room"])
def test_a_room_type_may_be_written_apart(name: str) -> None:
    assert room_from_dict(document(room_type=name)).room_type == "bedroom"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            b'{"id": "a",}',
            "expected JSON; .*; it has no comments, no single quotes, and no comma before a .*",
        ),
        (b'{"id" "a", "b": 1}', "expected JSON; Expecting ':' delimiter"),
        (b"PK\x03\x04\xff", "text: expected JSON; it is a ZIP file: if a home of Sweet Home 3D, name it .sh3d"),
    ],
)
def test_what_is_no_json_is_answered_with_what_may_be_meant(text: bytes, said: str) -> None:
    assert re.search(f"{said}$", str(parsed(text)))


@pytest.mark.parametrize(
    ("name", "said"), [("office", "got 'office', which is a study here"), ("crypt", "got 'crypt'")]
)
def test_a_room_type_of_another_name_is_refused_with_what_it_is_here(name: str, said: str) -> None:
    with pytest.raises(RoomError) as refused:
        room_from_dict(document(room_type=name))
    assert str(refused.value).endswith(said)


@pytest.mark.parametrize(
    ("host", "said", "tucked"),
    [
        ("desk", {}, True),
        ("table", {"rotation": 90}, True),
        ("bed", {}, False),
        ("desk", {"tucked": False}, False),
        ("desk", {"center": [3, 1]}, False),
    ],
)
def test_a_chair_to_be_placed_may_stand_under_a_desk_or_a_table_but_where_the_file_says_no(
    host: str, said: dict[str, Any], tucked: bool
) -> None:
    furniture = [{"category": host, "size": [0.6, 1.2]}, {"category": "chair", "size": [0.5, 0.5]} | said]
    room = room_from_dict(document(furniture=furniture))
    assert [item.tucked for item in room.furniture] == [False, tucked]
    assert room.furniture[1].rotation == (0 if "center" in said else said.get("rotation"))
    assert room_from_dict(room_to_dict(room)) == room
    if "center" not in said:
        assert without_poses(room.furniture, {1})[1].tucked == tucked


@given(rooms(group="plan 7", target=None))
def test_the_group_and_a_target_that_was_not_chosen_survive(room: Room) -> None:
    read = room_from_dict(json.loads(json.dumps(room_to_dict(room))))
    assert read.group == "plan 7"
    assert read.target == 0  # the builder's main item is there once, so that it is the target


def test_an_unplaced_item_survives_the_round_trip() -> None:
    room = rectangular_room(4, 3, item=Item("bed", (1.0, 2.0), None, 90.0))
    assert room_from_dict(json.loads(json.dumps(room_to_dict(room)))) == room


def test_what_may_be_left_out_may_be_null() -> None:
    nothing = dict.fromkeys(("holes", "walls", "target", "group"))
    entry = {"category": "bed", "size": [2.0, 1.5]}
    nulls = dict.fromkeys(("center", "rotation", "shape", "tucked", "locked"))
    read = room_from_dict(document(furniture=[entry | nulls]) | nothing)
    assert read == room_from_dict(document(furniture=[entry]))
    assert read.walls


def test_points_may_be_tuples() -> None:
    outline = document()["outline"]
    assert room_from_dict(document(outline=tuple(map(tuple, outline)))) == room_from_dict(document())


def test_what_is_no_more_than_rounding_from_zero_is_zero() -> None:
    tiny = document(outline=[[5e-324, -1e-13], [4, 0], [4, 3], [0, 3]])
    assert room_from_dict(tiny).outline == room_from_dict(document()).outline


def test_walls_left_out_are_a_band_cut_by_the_openings() -> None:
    room = room_from_dict(document())
    assert room.walls == wall_band(room.outline, (), room.openings)
    assert len(room.walls) == 6


def test_walls_that_are_given_are_kept_even_if_there_are_none() -> None:
    ring = rectangle(-0.1, 0.0, 0.0, 3.0)
    assert room_from_dict(document(walls=polygons([list(p) for p in ring]))).walls == (ring,)
    assert room_from_dict(document(walls=[])).walls == ()


def test_of_lengths_that_make_no_area_the_unit_is_asked_for() -> None:
    with pytest.raises(RoomError, match=r"an area; it has 4e-07 m²: is the unit right\?"):
        room_from_dict(document(outline=[[0, 0], [1e-3, 0], [1e-3, 4e-4], [0, 4e-4]]))


def test_holes_bound_the_indoor_area_and_may_be_left_out() -> None:
    assert room_from_dict(document()).holes == ()
    hole = [[2.5, 0.5], [3, 0.5], [3, 1], [2.5, 1]]
    room = room_from_dict(document(holes=[hole]))
    assert room.indoor.area == pytest.approx(12 - 0.25)
    assert not Polygon(room.holes[0]).exterior.is_ccw
    assert room_from_dict(document(holes=[hole[::-1]])) == room


def test_an_item_without_rotation_shape_and_centre_is_a_rectangle_to_be_placed_and_turned() -> None:
    bed = {"category": "bed", "size": [2, 1]}
    room = room_from_dict(document(furniture=[bed]))
    assert room.furniture == (Item("bed", (2.0, 1.0), None, None, "rectangle"),)
    assert room_from_dict(room_to_dict(room)) == room
    turned = room_from_dict(document(furniture=[bed | {"rotation": 90}]))
    assert turned.furniture == (Item("bed", (2.0, 1.0), None, 90.0),)


def test_an_item_that_stands_and_has_no_rotation_is_not_turned() -> None:
    room = room_from_dict(document(furniture=[{"category": "bed", "size": [2, 1], "center": [1.5, 1.5]}]))
    assert room.furniture[0].rotation == 0


@pytest.mark.parametrize("room_type", list(MAIN_ITEM))
def test_the_main_item_is_the_target_where_it_is_there_once(room_type: str) -> None:
    def target(*categories: str) -> int | None:
        furniture = [{"category": category, "size": [1, 1], "center": [1, 1]} for category in categories]
        return room_from_dict(document(room_type=room_type, furniture=furniture)).target

    main = MAIN_ITEM[room_type]
    assert target("plant", main) == 1
    assert target("plant", "plant") is None
    assert target(main, main) is None


def test_a_target_that_is_given_is_kept_and_the_group_is_the_id_where_none_is_given() -> None:
    room = room_from_dict(document(target=1))
    assert room.target == 1
    assert room.group == "b-17"
    assert room_from_dict(document(group="plan 3")).group == "plan 3"


@given(st.integers(0, 3), st.booleans(), st.booleans())
def test_a_clockwise_outline_and_a_repeated_closing_corner_change_nothing(
    start: int, clockwise: bool, closed: bool
) -> None:
    ring = [[0, 0], [4, 0], [4, 3], [0, 3]]
    ring = ring[start:] + ring[:start]
    ring = ring[::-1] if clockwise else ring
    room = room_from_dict(document(outline=ring + ring[: int(closed)]))
    assert len(room.outline) == 4
    assert Polygon(room.outline).exterior.is_ccw
    assert room.indoor.equals(Polygon(ring))
    assert sum(wall.area for wall in room.wall_shapes) == pytest.approx(14 * 0.2 + 4 * 0.04 - 2 * 0.2)


def test_a_clockwise_door_and_a_corner_named_twice_in_a_row_are_mended() -> None:
    door = document()["doors"][0]["polygon"]
    assert room_from_dict(document(doors=polygons([*door[::-1], door[-1]]))).doors[0].shape.exterior.is_ccw
    twice = [[0, 0], [4, 0], [4, 0], [4, 3], [0, 3]]
    assert room_from_dict(document(outline=twice)) == room_from_dict(document())


def test_fields_of_the_users_own_are_not_read_and_are_kept_with_a_layout() -> None:
    own = document(ceiling=2.5, note="for Ada")
    own["doors"][0]["width"] = 0.9
    own["furniture"][0] |= {"colour": "red", "faults": ["overlaps"]}
    known = room_from_dict(document())
    assert room_from_dict(own) == known
    bare = replace(known.furniture[0], center=None, rotation=None)
    asked = replace(known, furniture=(bare, *known.furniture[1:]))
    written = with_layout(own, asked, known, [(1, "outside"), (1, "overlaps")], ())
    assert written["furniture"][1].pop("faults") == ["outside", "overlaps"]
    del own["furniture"][0]["faults"]
    assert written == own
    nowhere = with_layout(own, asked, asked, [], ())
    assert nowhere == own  # what is not placed is left where it was
    own["furniture"][0]["faults"] = "scratched"  # no list of ours
    assert with_layout(own, asked, known, [(0, "outside")], ())["furniture"][0]["faults"] == "scratched"


def test_what_was_wrong_with_what_stands_is_kept_and_what_is_new_comes_to_it() -> None:
    own = document()
    own["furniture"][0]["faults"] = ["off its wall"]
    own["furniture"][1]["faults"] = "a scratch"  # the user's own
    room = room_from_dict(own)
    written = with_layout(
        own, room, room, [(0, "off its wall"), (0, "overlaps"), (1, "overlaps")], {(0, "off its wall")}
    )
    assert [item["faults"] for item in written["furniture"][:2]] == [["off its wall", "overlaps"], "a scratch"]
    assert own["furniture"][0]["faults"] == ["off its wall"]


def test_faults_that_are_null_are_none_yet() -> None:
    asked = document(furniture=[{"category": "bed", "size": [2.0, 1.5], "center": [1, 1], "faults": None}])
    room = room_from_dict(asked)
    (entry,) = with_layout(asked, room, room, [(0, "overlaps")], set())["furniture"]
    assert entry["faults"] == ["overlaps"]
    (entry,) = with_layout(asked, room, room, [], set())["furniture"]
    assert "faults" not in entry


def test_of_what_was_wrong_with_what_stands_that_alone_is_kept_which_still_is() -> None:
    own = document()
    scratch = [{"scratch": 1}, "a scratch"]  # the user's own
    for entry, listed in zip(own["furniture"], (["off its wall", *scratch, "overlaps"], ["outside"]), strict=False):
        entry["faults"] = listed
    room = room_from_dict(own)
    written = with_layout(own, room, room, [], {(0, "overlaps"), (1, "overlaps")})
    assert written["furniture"][0]["faults"] == [*scratch, "overlaps"]
    assert "faults" not in written["furniture"][1]


@pytest.mark.parametrize("field", ["id", "group"])
def test_a_name_that_cannot_be_written_is_refused(field: str) -> None:
    with pytest.raises(RoomError, match=f"^{field}: expected text that can be written as UTF-8"):
        room_from_dict(document(**{field: "\ud800"}))


def test_notes_are_kept_however_deep_they_are() -> None:
    deep: list[Any] = []
    for _ in range(700):
        deep = [deep]
    noted = document(notes=deep)
    room = room_from_dict(noted)
    assert with_layout(noted, room, room, [], ())["notes"] is deep


def test_a_room_error_keeps_field_and_problem_apart() -> None:
    with pytest.raises(RoomError) as raised:
        room_from_dict(document(target=9))
    assert raised.value.field == "target"
    assert raised.value.problem == "expected the index of a piece of furniture, 0 to 1; got 9"


def test_an_opening_that_reaches_beyond_the_walls_is_refused() -> None:
    doors = [{"polygon": [[1, -5], [2, -5], [2, 0], [1, 0]]}]
    with pytest.raises(RoomError, match=r"doors\[0\]: expected to lie in the walls"):
        room_from_dict(document(doors=doors))


def test_a_window_may_be_deeper_than_the_wall_up_to_where_its_corners_are() -> None:
    deep = document(windows=polygons([[1, 3], [2, 3], [2, 3.28], [1, 3.28]]))
    assert room_from_dict(deep).windows
    with pytest.raises(RoomError, match=r"windows\[0\]: expected to lie in the walls"):
        room_from_dict(document(windows=polygons([[1, 3], [2, 3], [2, 3.3], [1, 3.3]])))


def test_a_door_deeper_than_the_walls_that_are_assumed_is_refused() -> None:
    deep = polygons([[1, -0.25], [2, -0.25], [2, 0], [1, 0]])
    with pytest.raises(RoomError, match=r"doors\[0\]: expected to lie in the walls \(0\.20 m\); it reaches 0\.25 m"):
        room_from_dict(document(doors=deep))
    walls = polygons([[0, -0.25], [1, -0.25], [1, 0], [0, 0]])
    assert room_from_dict(document(doors=deep, walls=walls)).doors


def test_a_pointed_corner_lets_no_window_be_deeper() -> None:
    pointed = document(outline=[[0, 0], [4, 0], [4, 3], [-5, 3]])  # the walls' own corner is half a metre off
    assert room_from_dict(pointed).windows
    with pytest.raises(RoomError, match=r"windows\[0\]: expected to lie in the walls \(0\.28 m\)"):
        room_from_dict(pointed | {"windows": polygons([[1, 3], [2, 3], [2, 3.4], [1, 3.4]])})


def test_a_room_in_millimetres_is_refused() -> None:
    with pytest.raises(RoomError, match="metres"):
        room_from_dict(document(outline=[[0, 0], [3600, 0], [3600, 4200], [0, 4200]]))


@pytest.mark.filterwarnings("ignore:.*encountered in:RuntimeWarning")  # GEOS's own
def test_an_outline_around_which_no_walls_can_be_drawn_is_answered() -> None:
    leaning = [[0, -3e-06], [4, 0], [4.000001, 2], [2.000003, 2.000001], [1.999997, 4.000003], [2e-06, 4]]
    document = {"id": "a", "room_type": "study", "outline": leaning, "doors": [], "windows": [], "furniture": []}
    with pytest.raises(RoomError, match="walls: cannot be drawn around this outline; expected them to be given"):
        room_from_dict(document)


def test_a_window_through_a_thick_wall_is_read_where_walls_are_given_and_said_so_where_not() -> None:
    window = polygons([[1, 3], [2, 3], [2, 3.36], [1, 3.36]])
    with pytest.raises(
        RoomError, match=r"it reaches 0\.36 m out; give walls that are thicker as `walls`, or say another unit"
    ):
        room_from_dict(document(windows=window))
    wall = polygons([[0, 3], [1, 3], [1, 3.36], [0, 3.36]])
    assert len(room_from_dict(document(windows=window, walls=wall)).windows) == 1


def test_a_locked_item_survives_and_stands_somewhere() -> None:
    bed = Item("bed", (2.0, 1.6), (1.0, 1.5), 0.0, locked=True)
    room = rectangular_room(4, 3, bed)
    document = room_to_dict(room)
    assert document["furniture"][0]["locked"] is True
    assert room_from_dict(document) == room
    assert "locked" not in room_to_dict(rectangular_room(4, 3, replace(bed, locked=False)))["furniture"][0]
    for wrong, expected in ((1, "true or false"), ("yes", "true or false")):
        document["furniture"][0]["locked"] = wrong
        with pytest.raises(RoomError, match=rf"furniture\[0\].locked: expected {expected}"):
            room_from_dict(document)
    del document["furniture"][0]["center"]
    document["furniture"][0]["locked"] = True
    with pytest.raises(RoomError, match=r"furniture\[0\].locked: expected a center"):
        room_from_dict(document)


@pytest.mark.parametrize(
    ("named", "ours"),
    [("position", "center"), ("pos", "center"), ("x", "center"), ("y", "center"), ("angle", "rotation")],
)
def test_where_an_item_stands_is_not_overlooked_under_another_name(named: str, ours: str) -> None:
    item: dict[str, Any] = {"category": "bed", "size": [2.1, 1.5], named: 1.0}
    document = room_to_dict(rectangular_room()) | {"furniture": [item]}
    with pytest.raises(RoomError, match=rf"^furniture\[0\]\.{named}: unknown field; expected {ours}, "):
        room_from_dict(document)
    both = item | {"center": [1.5, 1.5], "rotation": 0}
    assert room_from_dict(document | {"furniture": [both]}).furniture[0].center == (1.5, 1.5)


def test_the_unit_of_a_number_is_said() -> None:
    item = {"category": "bed", "size": [2.1, 1.5], "center": [1, 1], "rotation": "east"}
    document = room_to_dict(rectangular_room())
    with pytest.raises(RoomError, match=r"rotation: expected a finite number of at most 1000 \(degrees\)"):
        room_from_dict(document | {"furniture": [item]})
    with pytest.raises(RoomError, match=r"size: expected a finite number of at most 1000 \(metres\)"):
        room_from_dict(document | {"furniture": [item | {"size": ["east", 1]}]})
