"""What the page is answered: faults as `faults` finds them, openings through walls, layouts of what is not locked."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
from statistics import median_low
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from layoutrl import InputError
from layoutrl.demo.answers import Answers, palette
from layoutrl.demo.furnisher import staff_of
from layoutrl.demo.shell import gaps, swings, with_opening, without_opening
from layoutrl.rooms.brief import brief_of, missing, with_poses
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.documents import room_from_dict, room_to_dict
from layoutrl.rooms.faults import OVERLAPS, Items, faults
from layoutrl.rooms.furnished import Furnished, same
from layoutrl.rooms.oddities import ASTRAY, BEFORE_WINDOW, IN_SWING, OFF_ITS_WALL, item_oddities, oddities
from layoutrl.rooms.room import MAIN_ITEM, Item, Room
from layoutrl.runs import pretrained
from layoutrl.runs.checked_brief import checked_brief
from layoutrl.runs.config import composed
from layoutrl.runs.furnishers import Helped
from tests.rooms.sources.test_procthor import house
from tests.rooms.sources.test_sweethome3d import FLAT, home_file, piece

ROOMS = [room for room_type in MAIN_ITEM for room in design_rooms(room_type, "test", 3, 3).rooms]
any_room = st.sampled_from(ROOMS)


def body(room: Room, **more: Any) -> bytes:
    return json.dumps({"room": room_to_dict(room), **more}).encode()


def test_the_gallery_shows_faultless_rooms_of_all_types(answers):
    rooms = [room_from_dict(entry["room"]) for entry in answers.begin["gallery"]]
    assert {room.room_type for room in rooms} == {*MAIN_ITEM}
    assert not any(faults(room) for room in rooms)


def test_the_page_is_told_which_faults_are_oddities(answers):
    room = ROOMS[0]
    assert answers.begin["oddities"] == [*item_oddities([room], Items.of([room]))]


def test_the_palette_has_the_sizes_of_designed_rooms(answers):
    for room_type, entries in answers.begin["palette"].items():
        designed = {item.category for room in ROOMS if room.room_type == room_type for item in room.furniture}
        assert designed <= {entry["item"]["category"] for entry in entries}
        assert MAIN_ITEM[room_type] in {entry["item"]["category"] for entry in entries if entry["usual"]}


def test_the_palette_has_the_median_depth_and_width_of_each_kind():
    for item in (entry["item"] for entry in palette(ROOMS)):
        kind = item["category"], item.get("shape", "rectangle")
        sizes = [one.size for room in ROOMS for one in room.furniture if (one.category, one.form) == kind]
        assert item["size"] == [*map(median_low, zip(*sizes, strict=True))]


def test_a_look_says_what_faults_says(answers):
    for room in ROOMS[::5]:
        crowded = room_to_dict(room)
        crowded["furniture"] += [crowded["furniture"][0]]  # one in the other
        said = answers.answer("look", json.dumps({"room": crowded}).encode())
        assert [(k, name) for k, name, _ in said["faults"]] == faults(room_from_dict(crowded))
        assert any("overlaps" in words for _, _, words in said["faults"])
        assert room_from_dict(said["room"]) == room_from_dict(crowded)


def test_a_look_says_in_words_what_left_the_room_and_numbers_what_is_alike(answers):
    beds = (Item("loft_bed", (2.0, 1.0), (x, 1.5), 0.0) for x in (2.0, 2.2))
    room = with_corner(*beds)
    said = answers.answer("look", body(room))["faults"]
    assert [0, OVERLAPS, "loft bed (1 of 2) overlaps something"] in said
    assert [2, OVERLAPS, "loft bed (2 of 2) overlaps something"] in said
    document = room_to_dict(room)
    wrong = ([9, 9], r"The loft bed \(2 of 2\) would reach beyond the walls$"), ([9], r"furniture\[2\]\.center: ")
    for document["furniture"][2]["center"], words in wrong:
        with pytest.raises(InputError, match=f"^{words}"):
            answers.answer("look", json.dumps({"room": document}).encode())


def test_a_drawing_marks_what_a_look_says(answers):
    room = with_corner(Item("wardrobe", (0.6, 1.2), (2.0, 1.5), 0.0))
    assert (0, OFF_ITS_WALL) in oddities(room)
    said = answers.answer("look", body(room))["faults"]
    drawn = ElementTree.fromstring(answers.answer("svg", body(room))["svg"])
    for k in range(len(room.furniture)):
        marked = drawn.find(f".//*[@data-id='{k}']").get("data-faults", "")
        assert marked == ", ".join(name for item, name, _ in said if item == k)


@given(any_room, st.data())
def test_gaps_are_free_and_end_at_a_wall_or_an_item(room, data):
    index = data.draw(st.integers(0, len(room.furniture) - 1))
    item = room.furniture[index]
    for (start, end), metres in gaps(room, index):
        assert np.hypot(*np.subtract(start, end)) == pytest.approx(metres)
        assert shapely.distance(item.footprint, shapely.Point(start)) < 1e-3
        others = [other.footprint for k, other in enumerate(room.furniture) if k != index]
        met = [shape for shape in (*others, room.indoor.boundary) if shape.distance(shapely.Point(end)) < 1e-6]
        assert met
        assert room.indoor.buffer(0.02).covers(shapely.LineString([start, end]))


def test_doors_swing_into_the_room_from_a_corner_of_it():
    room = room_from_dict(
        {"id": "a", "room_type": "bedroom", "outline": [[0, 0], [4, 0], [4, 3], [0, 3]], "windows": [], "furniture": [],
         "doors": [{"polygon": [[0.2, -0.2], [1.1, -0.2], [1.1, 0], [0.2, 0]]},
                   {"polygon": [[4, 0.5], [4.2, 0.5], [4.2, 2.5], [4, 2.5]]}]}
    )  # fmt: skip
    assert swings(room) == ["M0.2000 0.0000L0.2000 0.9000A0.9 0.9 0 0 0 1.1000 0.0000", ""]  # the second slides


@given(any_room, st.data(), st.sampled_from(("door", "window")), st.floats(0.5, 1.2))
def test_an_opening_cuts_the_wall_and_taken_out_leaves_it_whole(room, data, kind, width):
    x0, y0, x1, y1 = room.indoor.bounds
    at = data.draw(st.floats(x0, x1)), data.draw(st.floats(y0, y1))
    try:
        opened = with_opening(room, kind, at, width)
    except InputError:  # a short wall, or one that has an opening there
        return
    read = room_from_dict(room_to_dict(opened))
    (new,) = {o.polygon for o in read.openings} - {o.polygon for o in room_from_dict(room_to_dict(room)).openings}
    shape = shapely.Polygon(new)
    assert shape.length / 2 - width == pytest.approx(shape.area / width, abs=1e-6)
    assert shapely.union_all(read.wall_shapes).intersection(shape).area < 1e-4
    assert read.envelope.symmetric_difference(room.envelope).area < 0.01
    index = [o.polygon for o in read.openings].index(new)
    closed = without_opening(read, index)
    assert shapely.union_all(closed.wall_shapes).symmetric_difference(shapely.union_all(room.wall_shapes)).area < 0.01


def test_a_room_of_ones_own_gets_doors_and_windows(answers):
    document = {"id": "mine", "room_type": "study", "outline": [[0, 0], [3, 0], [3, 3.5], [0, 3.5]]}
    document |= {"doors": [], "windows": [], "furniture": []}
    asked = {"room": document, "kind": "door", "at": [1.0, 0.1], "width": 0.9}
    said = answers.answer("opening", json.dumps(asked).encode())
    assert said["room"]["doors"] == [{"polygon": [[0.55, 0.0], [0.55, -0.2], [1.45, -0.2], [1.45, 0.0]]}]
    asked = {"room": said["room"], "kind": "window", "at": [1.1, 0.0], "width": 0.9}
    with pytest.raises(InputError, match="there is one already"):
        answers.answer("opening", json.dumps(asked).encode())
    gone = answers.answer("opening", json.dumps({"room": said["room"], "remove": 0}).encode())
    assert gone["room"]["doors"] == []


@pytest.mark.parametrize("room", ROOMS[::4], ids=lambda room: room.id)
def test_furnishing_places_what_is_not_locked_and_leaves_the_rest(answers, room):
    movable = list(range(1, len(room.furniture)))
    said = answers.answer("furnish", body(room, movable=movable))
    assert said["choices"]
    assert said["lines"] == []
    layouts = [room_from_dict(room_to_dict(room) | {"furniture": c["furniture"]}) for c in said["choices"]]
    for layout, choice in zip(layouts, said["choices"], strict=True):
        assert layout.furniture[0] == room.furniture[0]
        assert sorted((k, name) for k, name, _ in choice["faults"]) == sorted(faults(layout) + oddities(layout))
        ends = {k: (tuple(center), degrees) for k, center, degrees in choice["path"]}
        assert ends == {k: (layout.furniture[k].center, layout.furniture[k].rotation) for k in movable if k in ends}
        assert {*ends} == {k for k in movable if layout.furniture[k].center}
    assert not any(same(one, other) for k, one in enumerate(layouts) for other in layouts[:k])
    values = [choice["value"] for choice in said["choices"]]
    assert values == sorted(values, reverse=True)


def test_only_what_is_asked_for_is_placed_though_more_has_no_place(answers):
    wardrobe, desk = Item("wardrobe", (0.6, 1.2), None, None), Item("desk", (0.6, 1.2), None, None)
    room = with_corner(wardrobe, desk)
    for movable, placed in (([1], {1}), ([0, 1], {0, 1}), ([2], {2}), ([0], {0})):
        said = answers.answer("furnish", body(room, movable=movable))
        assert said["lines"] == []
        for choice in said["choices"]:
            layout = room_from_dict(room_to_dict(room) | {"furniture": choice["furniture"]})
            assert {k for k, _, _ in choice["path"]} == placed
            assert {*missing(layout)} == {0, 2} - placed
            assert all(layout.furniture[k] == room.furniture[k] for k in {0, 1, 2} - placed)
        assert said["choices"]


def test_as_many_layouts_are_found_as_are_asked_for(answers):
    room = ROOMS[0]
    movable = [*range(len(room.furniture))]
    assert len(answers.answer("furnish", body(room, movable=movable, choices=1))["choices"]) == 1
    with pytest.raises(InputError, match="choices: expected a number from 1 to 3"):
        answers.answer("furnish", body(room, movable=movable, choices=4))
    for half in ({"choices": 1.5}, {"seed": 0.5}):
        with pytest.raises(InputError, match="expected a whole number from"):
            answers.answer("furnish", body(room, movable=movable, **half))
    with pytest.raises(InputError, match="choises: unknown field; expected some of room, item"):
        answers.answer("furnish", body(room, movable=movable, choises=1))


def test_what_is_to_be_furnished_may_have_the_names_that_place_knows(answers):
    document = room_to_dict(with_corner(Item("wardrobe", (0.6, 1.2), None, None)))
    document["furniture"][0]["category"] = "Kleiderschrank"
    said = answers.answer("furnish", json.dumps({"room": document, "movable": [0]}).encode())
    assert said["lines"] == []
    assert said["choices"][0]["furniture"][0]["category"] == "wardrobe"
    assert "center" in said["choices"][0]["furniture"][0]
    document["furniture"][0] |= {"category": "Couch", "center": [2.0, 2.0], "rotation": 0}
    with pytest.raises(InputError, match="nobody places a sofa in a bedroom"):
        answers.answer("moves", json.dumps({"room": document, "item": 0}).encode())
    with pytest.raises(InputError, match="choises: unknown field"):
        answers.home(body(ROOMS[0], choises=1))


def test_the_furnisher_is_given_the_choices_and_the_seed_that_are_asked_for(answers, monkeypatch):
    given = []

    class Told:
        def furnish(self, briefs, choices, seed):
            given.append((choices, seed))
            return [[] for _ in briefs]

    monkeypatch.setattr(answers, "staff", replace(answers.staff, furnisher=Told))
    answers.answer("furnish", body(ROOMS[0], movable=[0], choices=2, seed=5))
    assert given == [(2, 5)]


def test_the_same_seed_gives_the_same_layouts(answers):
    room, furnisher = ROOMS[0], answers.staff.furnisher()
    first, second = (furnisher.furnish([brief_of(room)], 3, seed=4) for _ in range(2))
    assert [[f.layout for f in found] for found in first] == [[f.layout for f in found] for found in second]


def test_what_nobody_knows_is_named_and_the_others_are_placed(answers):
    document = room_to_dict(ROOMS[0])
    document["furniture"].insert(0, {"category": "piano", "size": [1.5, 0.6]})
    movable = list(range(len(document["furniture"])))
    said = answers.answer("furnish", json.dumps({"room": document, "movable": movable}).encode())
    assert "the piano is not placed" in said["lines"][0]
    assert "center" not in said["choices"][0]["furniture"][0]
    assert {k for k, _, _ in said["choices"][0]["path"]} == {*movable} - {0}
    assert said["lines"] == checked_brief(brief_of(room_from_dict(document)), answers.staff.known("bathroom")).lines


def with_corner(item: Item, *others: Item) -> Room:
    """A bedroom of four by three metres, with a bed and what else is named."""
    bed = Item("bed", (2.0, 1.4), (1.0, 2.3), 0.0)
    document = {"id": "a", "room_type": "bedroom", "outline": [[0, 0], [4, 0], [4, 3], [0, 3]], "windows": []}
    document |= {"doors": [{"polygon": [[3, -0.2], [3.9, -0.2], [3.9, 0], [3, 0]]}], "furniture": []}
    return replace(room_from_dict(document), furniture=(item, bed, *others))


def test_what_stands_and_nobody_knows_stays_and_is_in_the_way(answers):
    fireplace = Item("fireplace", (0.5, 1.6), (1.0, 0.25), 90.0)
    room = with_corner(fireplace)
    said = answers.answer("furnish", body(room, movable=[0, 1]))
    assert said["lines"] == ["nobody places these in a bedroom, and they stay: fireplace"]
    assert said["choices"]
    for choice in said["choices"]:
        layout = room_from_dict(room_to_dict(room) | {"furniture": choice["furniture"]})
        assert layout.furniture[0] == fireplace
        assert layout.furniture[1].footprint.intersection(fireplace.footprint).area < 1e-3
        assert {k for k, _, _ in choice["path"]} == {1}
    with pytest.raises(InputError, match="nothing to furnish; nobody places these in a bedroom, and they stay: fire"):
        answers.answer("furnish", body(room, movable=[0]))


def test_a_chair_under_what_nobody_knows_stays_and_goes_from_what_is_only_locked(answers, monkeypatch):
    chair = Item("chair", (0.5, 0.5), (3.2, 2.0), 90.0, tucked=True)
    desk = Item("desk", (0.6, 1.2), (3.3, 2.4), 270.0)
    known = [*answers.staff.known("bedroom")]
    assert {"chair", "desk"} <= {*known}
    room = with_corner(desk, chair)
    said = answers.answer("furnish", body(room, movable=[2]))
    assert {k for k, _, _ in said["choices"][0]["path"]} == {2}
    monkeypatch.setattr(answers, "staff", replace(answers.staff, known=lambda _: {*known} - {"desk"}))
    said = answers.answer("furnish", body(room, movable=[0, 1, 2]))
    stays = "nobody places these in a bedroom, and they stay: desk; what is tucked under them stays, too: chair"
    assert said["lines"] == [stays]
    kept = [room_to_dict(room)["furniture"][k] for k in (0, 2)]
    assert all([choice["furniture"][k] for k in (0, 2)] == kept for choice in said["choices"])


def test_what_is_locked_stays_and_stays_locked_though_it_is_to_move(answers):
    room = with_corner(Item("wardrobe", (0.6, 1.2), (2.0, 2.0), 90.0, locked=True))
    said = answers.answer("furnish", body(room, movable=[0, 1]))
    assert {k for k, _, _ in said["choices"][0]["path"]} == {1}
    assert all(choice["furniture"][0] == room_to_dict(room)["furniture"][0] for choice in said["choices"])


def test_what_fits_in_no_other_way_stays_where_it_stands(answers):
    wide = Item("wardrobe", (0.6, 4.3), (2.0, 0.25), 90.0)  # it reaches into the walls, as homes are drawn
    room = with_corner(wide)
    said = answers.answer("furnish", body(room, movable=[0, 1]))
    assert "the wardrobe of 0.6 by 4.3 m is not placed" in said["lines"][0]
    stands = room_to_dict(room)["furniture"][0]
    assert all(choice["furniture"][0] == stands for choice in said["choices"])
    assert {k for k, _, _ in said["choices"][0]["path"]} == {1}


def test_what_an_agent_calls_otherwise_has_values_and_moves_too():
    told = Answers(staff_of(composed("demo").search))
    washer = {"category": "washer", "size": [0.6, 0.6], "center": [0.3, 2.0], "rotation": 0}
    room = {"id": "a", "room_type": "bathroom", "outline": [[0, 0], [3, 0], [3, 3], [0, 3]], "windows": []}
    room |= {"doors": [], "furniture": [washer]}
    asked = {"room": room, "item": 0, "step": 0.5}
    values, moves = (told.questions[question](asked) for question in ("values", "moves"))
    room["furniture"] = [washer | {"category": "washing_machine"}]
    assert values == told.questions["values"](asked)
    assert moves == told.questions["moves"](asked)
    assert moves["moves"]


def test_the_agents_of_the_package_furnish_and_the_search_helps_them():
    staff = staff_of(composed("demo").search)
    helped = staff.furnisher()
    assert isinstance(helped, Helped)
    assert staff.furnisher() is helped
    assert staff.thinker("bathroom") is helped.one.of("bathroom")
    assert staff.known("bathroom") == {*pretrained.cards()["bathroom"]["categories"], "sink", "washer"}


def test_who_furnishes_in_an_agents_place_is_named(answers, monkeypatch):
    class Piler:
        def furnish(self, briefs, choices, seed):
            (brief,) = briefs
            return [[Furnished(with_poses(brief, dict.fromkeys(missing(brief), ((1.0, 1.0), 0.0))), 0.0)]]

    room, movable = ROOMS[3], [*range(len(ROOMS[3].furniture))]
    said = answers.answer("furnish", body(room, movable=movable))
    assert {choice["by"] for choice in said["choices"]} == {""}
    helped = Helped(Piler(), answers.staff.furnisher())
    monkeypatch.setattr(answers, "staff", replace(answers.staff, furnisher=lambda: helped))
    said = answers.answer("furnish", body(room, movable=movable))
    assert [choice["by"] for choice in said["choices"]] == ["the search"] * 3
    assert {name for _, name, _ in said["choices"][0]["faults"]} <= {OFF_ITS_WALL, ASTRAY, BEFORE_WINDOW, IN_SWING}


def test_rugs_stay_where_they_lie(answers):
    room = ROOMS[3]
    with_rug = replace(room, furniture=(*room.furniture, Item("rug", (1.0, 1.5), room.furniture[0].center, 0.0)))
    said = answers.answer("furnish", body(with_rug, movable=[*range(len(with_rug.furniture))]))
    assert not said["lines"]
    for choice in said["choices"]:
        assert choice["furniture"][-1]["center"] == [*room.furniture[0].center]


def test_a_room_is_furnished_by_the_agent_of_its_type(answers, monkeypatch):
    monkeypatch.setattr("layoutrl.rivals.rooms.rival.DESIGNED", 20)  # of the search that helps
    monkeypatch.setattr(answers, "staff", staff_of(composed("demo").search))
    room = next(room for room in ROOMS if room.room_type == "bathroom")
    said = answers.answer("furnish", body(room, movable=[*range(len(room.furniture))]))
    assert said["choices"]
    assert all("center" in item for choice in said["choices"] for item in choice["furniture"])
    assert len(said["choices"][0]["path"]) > len(room.furniture)  # of an agent's moves


def test_an_agent_of_the_package_says_what_it_thinks_of_places(answers, monkeypatch):
    monkeypatch.setattr(answers, "staff", staff_of(composed("demo").search))
    room = next(room for room in ROOMS if room.room_type == "bathroom")
    said = answers.answer("values", body(room, item=0, step=0.4))
    places = [
        replace(room.furniture[0], center=tuple(c), rotation=d)
        for c, d in zip(said["centers"], said["degrees"], strict=True)
    ]
    assert len(said["values"]) == len(places) > 10
    assert all(room.envelope.buffer(1e-5).covers(place.footprint) for place in places)
    moves = answers.answer("moves", body(room, item=0))["moves"]
    assert [move["value"] for move in moves] == sorted((move["value"] for move in moves), reverse=True)
    assert len({tuple(move["to"]) for move in moves}) > 4
    huge = Item("vanity", (0.6, 9.0), None, None)  # what cannot be placed is in nobody's way
    crowded, about = replace(room, furniture=(huge, *room.furniture)), {"item": 1, "step": 0.4}
    assert answers.answer("values", body(crowded, **about)) == said
    assert answers.answer("moves", body(crowded, **about))["moves"] == moves
    rug = replace(room, furniture=(Item("rug", (0.6, 0.6), (1.0, 1.0), 0.0), *room.furniture))  # nor are rugs
    assert answers.answer("values", body(rug, **about)) == said
    with pytest.raises(InputError, match="item: nobody places a rug"):
        answers.answer("values", body(rug, item=0))


def test_thoughts_are_answered_by_who_thinks(answers):
    room = ROOMS[0]
    said = answers.answer("values", body(room, item=0, step=0.25))
    assert len(said["centers"]) == len(said["values"]) == len(said["degrees"]) > 10
    said = answers.answer("moves", body(room, item=0))
    assert [move["name"] for move in said["moves"]] == ["left", "down"]


@pytest.mark.parametrize(("article", "category"), [("a", "piano"), ("an", "aquarium"), ("a", "cooktop")])
def test_there_are_no_thoughts_of_what_nobody_places_in_such_a_room(answers, article, category):
    room = with_corner(Item(category, (0.4, 0.8), (2.5, 2.5), 0.0))
    for question in ("values", "moves"):
        with pytest.raises(InputError, match=f"item: nobody places {article} {category} in a bedroom; expected other"):
            answers.answer(question, body(room, item=0))
        assert answers.answer(question, body(room, item=1))


def lines_of(rooms: Sequence[Room]) -> bytes:
    return "\n".join(json.dumps(room_to_dict(room)) for room in rooms).encode()


def test_files_are_read_and_what_is_wrong_is_said(answers):
    said = answers.read(lines_of(ROOMS[:3]) + b"\n{}\n")
    assert [entry["room"]["id"] for entry in said["rooms"]] == [room.id for room in ROOMS[:3]]
    assert said["left_out"] == ["line:4: id: missing; expected a name"]
    one = answers.read(json.dumps(room_to_dict(ROOMS[0]), indent=2).encode())
    assert len(one["rooms"]) == 1
    for content, match in ((b"", "empty"), (b"nonsense", "expected JSON"), (b"PK\x03\x04nonsense", "file|sh3d")):
        with pytest.raises(InputError, match=match) as found:
            answers.read(content)
        assert "/tmp" not in str(found.value)


def test_of_a_file_the_first_rooms_are_shown_and_none_that_is_too_large_to_be_asked_about(answers, monkeypatch):
    monkeypatch.setattr("layoutrl.demo.answers.MOST_ROOMS", 2)
    said = answers.read(lines_of(ROOMS[:3]))
    assert [entry["room"]["id"] for entry in said["rooms"]] == [room.id for room in ROOMS[:2]]
    assert said["left_out"] == ["1 more rooms are left out; expected at most 2"]
    monkeypatch.setattr("layoutrl.demo.answers.MOST_ITEMS", len(ROOMS[0].furniture) - 1)
    said = answers.read(lines_of([ROOMS[0], replace(ROOMS[1], furniture=(), target=None)]))
    assert [entry["room"]["id"] for entry in said["rooms"]] == [ROOMS[1].id]
    assert said["left_out"][0].startswith(f"{ROOMS[0].id}: furniture: expected at most ")


def test_a_broken_file_is_told_where_it_is_broken(answers):
    lines = json.dumps(room_to_dict(ROOMS[0]), indent=2).splitlines()
    lines[20] += ","
    for content in (lines, ["[", *lines, "]"]):
        with pytest.raises(InputError, match=r"^file:1: line 2\d, column \d+: expected JSON; ") as found:
            answers.read("\n".join(content).encode())
        assert "whole JSON object" not in str(found.value)
    with pytest.raises(InputError, match=r"^file:1: line 2, column \d+: expected JSON; "):
        answers.read(b'[\n{"id": "a",},\n{"id": "b"}\n]')
    said = answers.read(b"{broken\n" + lines_of(ROOMS[:2]))
    assert [entry["room"]["id"] for entry in said["rooms"]] == [room.id for room in ROOMS[:2]]
    assert said["left_out"][0].startswith("line:1: column 2: expected JSON")
    with pytest.raises(InputError, match=r"^line:1: line: expected one whole JSON object; the text breaks off$"):
        answers.read(lines_of(ROOMS[:1])[:-40])


def test_houses_without_the_sizes_of_their_furniture_are_left_to_place(answers):
    line = "^file: houses of ProcTHOR are read by `place`, beside their asset database; expected rooms in JSON"
    for houses in ([house()], [house(), house()]):
        with pytest.raises(InputError, match=line):
            answers.read("\n".join(map(json.dumps, houses)).encode())


def test_lengths_of_rooms_in_json_are_in_the_unit_that_is_chosen(answers, tmp_path):
    room = {"id": "a", "room_type": "study", "outline": [[0, 0], [144, 0], [144, 120], [0, 120]], "windows": []}
    room |= {"doors": [{"polygon": [[20, -8], [56, -8], [56, 0], [20, 0]]}], "furniture": []}
    content = json.dumps(room).encode()
    said = answers.read(content)
    assert said["rooms"][0]["room"]["outline"][1] == [1.44, 0]
    (line,) = said["left_out"]
    assert line.startswith("file: lengths are read as cm, as rooms are large (choose unit m if they are); ")
    assert line.endswith("(choose unit in if lengths are inches)")
    said = answers.read(content, "in")
    assert said["rooms"][0]["room"]["outline"][1] == pytest.approx([3.6576, 0])
    assert said["left_out"] == []
    home = home_file(tmp_path / "flat.sh3d").read_bytes()
    assert answers.read(home, "in") == answers.read(home)  # which says itself how long a metre is


@pytest.mark.parametrize("none", [{}, {"room_type": None}, {"room_type": ""}])
def test_a_room_in_json_without_a_type_is_taken_for_a_bedroom(answers, none):
    document = room_to_dict(ROOMS[0]) | {"id": "x", "furniture": []}
    del document["room_type"], document["target"]
    document |= none
    said = answers.read(json.dumps(document).encode())
    assert said["rooms"][0]["room"]["room_type"] == "bedroom"
    assert said["left_out"] == ["x: nothing tells its type; it is taken for a bedroom"]


def test_what_is_said_of_a_home_names_no_option_of_commands(answers, tmp_path):
    untold = FLAT.replace("Bedroom", "Xyz").replace("bed140x190", "whatsit")
    parked = piece("cooktop", 900, 100, 60, 60, id="parked")
    said = answers.read(home_file(tmp_path / "flat.sh3d", untold + parked).read_bytes())["left_out"]
    assert "file/Xyz: nothing tells its type; it is taken for a bedroom" in said
    for begin in ("'whatsit' (1) is no known", "the cooktop outside all rooms"):
        (line,) = (line for line in said if line.startswith(begin))
        assert "=" not in line


def test_furniture_of_a_file_may_have_everyday_names(answers):
    room = room_to_dict(next(room for room in ROOMS if room.room_type == "study"))
    everyday = [item | {"category": item["category"].replace("desk", "Schreibtisch")} for item in room["furniture"]]
    assert everyday != room["furniture"]
    (entry,) = answers.read(json.dumps(room | {"furniture": everyday}).encode())["rooms"]
    assert entry["room"]["furniture"] == room["furniture"]


def test_names_of_rooms_are_said_as_they_are(answers):
    name = "unit=cm (into=the attic)"
    with pytest.raises(InputError, match="room_type: missing") as found:
        answers.read(json.dumps({"id": name}).encode())
    assert name in str(found.value)


def test_a_home_tells_what_is_fixed_and_is_saved_with_all_its_rooms(answers, tmp_path):
    shelf = piece("bookcase", 300, 15, 80, 30, id="shelf", movable="false")
    content = home_file(tmp_path / "flat.sh3d", shelf + FLAT).read_bytes()
    said = answers.read(content)
    bedroom, bathroom = (entry["room"] for entry in said["rooms"])
    assert [entry["fixed"] for entry in said["rooms"]] == [[0], []]
    bedroom["furniture"][1]["center"] = [1.2, -1.3]
    bathroom["furniture"][0]["center"] = [5.1, -0.6]
    asked = {"room": bathroom, "others": [bedroom]}
    saved, left, without = answers.home(json.dumps(asked).encode() + b"\n" + content)
    assert (left, without) == ("", [])
    assert [entry["room"] for entry in answers.read(saved)["rooms"]] == [bedroom, bathroom]
    for others, match in (
        (7, "others: expected a list"),
        (100 * [bedroom], "fewer than 100"),
        ([{}], r"others\[0\]: id: missing"),
        ([bathroom], "each room of the home once"),
    ):
        with pytest.raises(InputError, match=match):
            answers.home(json.dumps({"room": bathroom, "others": others}).encode() + b"\n" + content)
    with pytest.raises(InputError, match="expected the home that they were read from"):
        answers.home(json.dumps(asked).encode())


@pytest.mark.parametrize(
    ("called", "stem"),
    [
        ("my flat", "my flat"),
        ("Küche 卧室 हिन्दी", "Küche 卧室 हिन्दी"),
        ("v2.1", "v2.1"),
        ("", "file"),
        (" ..", "file"),
        ("../../etc/passwd", "_.._etc_passwd"),
        ("/etc/passwd", "_etc_passwd"),
        ("a\\b\0c\nd", "a_b_c_d"),
        ("\N{BED}" * 500, "\N{BED}" * 60),
    ],
)
def test_rooms_of_a_home_are_called_as_its_file_which_is_no_path(answers, tmp_path, called, stem):
    content = home_file(tmp_path / "flat.sh3d").read_bytes()
    bedroom, bathroom = (entry["room"] for entry in answers.read(content, called=called)["rooms"])
    assert [bedroom["id"], bathroom["id"]] == [f"{stem}/Bedroom", f"{stem}/room 2"]
    assert bedroom["group"] == bathroom["group"] == stem
    bathroom["furniture"][0]["center"] = [5.1, -0.6]
    body = json.dumps({"room": bedroom, "others": [bathroom]}).encode() + b"\n" + content
    saved, left, _ = answers.home(body, called)
    assert left == ""
    assert [entry["room"] for entry in answers.read(saved, called=called)["rooms"]] == [bedroom, bathroom]
    with pytest.raises(InputError, match="has other: save it as JSON"):
        answers.home(body, "another home")


def test_a_home_of_a_great_many_files_is_refused_before_they_are_listed(answers, tmp_path, monkeypatch):
    content = home_file(tmp_path / "flat.sh3d").read_bytes()
    room = answers.read(content)["rooms"][0]["room"]
    for most, match in ((4, None), (3, "^file: expected at most 3 files in a home")):
        monkeypatch.setattr("layoutrl.demo.opened_file.MOST_ENTRIES", most)
        for ask in (answers.read, lambda home: answers.home(json.dumps({"room": room}).encode() + b"\n" + home)):
            with pytest.raises(InputError, match=match) if match else nullcontext():
                ask(content)


def test_other_rooms_that_cannot_be_saved_are_left_as_they_were_and_named(answers, tmp_path):
    content = home_file(tmp_path / "flat.sh3d").read_bytes()
    bedroom, bathroom = (entry["room"] for entry in answers.read(content)["rooms"])
    bathroom["furniture"][0]["center"] = [5.1, -0.6]
    unreadable = bedroom | {"furniture": 41 * bedroom["furniture"]}
    for other in (bedroom | {"furniture": []}, unreadable, bedroom | {"id": "another"}):
        saved, left, without = answers.home(
            json.dumps({"room": bathroom, "others": [other]}).encode() + b"\n" + content
        )
        assert without == [0]
        assert left.startswith(f"home: saved, but as it was before in {other['id']!r}: ")
        assert [entry["room"] for entry in answers.read(saved)["rooms"]] == [bedroom, bathroom]


def test_a_home_of_many_full_rooms_is_saved_and_each_is_bounded(answers, tmp_path):
    content = home_file(tmp_path / "flat.sh3d").read_bytes()
    bedroom, bathroom = (entry["room"] for entry in answers.read(content)["rooms"])
    full = bedroom | {"furniture": 40 * bedroom["furniture"]}
    others = [full | {"id": f"full {k}"} for k in range(99)]
    line = json.dumps({"room": bathroom, "others": others}).encode()
    assert len(line) > 200_000
    _, left, without = answers.home(line + b"\n" + content)
    assert without == [*range(99)]
    assert "'full 98'" in left
    large = json.dumps({"room": bathroom | {"more": 500_000 * "a"}, "others": [full]}).encode()
    for body in (line, large + b"\n" + content):
        with pytest.raises(InputError, match="at most 200 kB"):
            answers.home(body)


@pytest.mark.parametrize("degrees", [0.0, 90.0, 180.0, 270.0])
def test_a_rotation_that_is_given_is_kept_of_what_has_no_place_yet(answers, degrees):
    room = ROOMS[0]
    given = replace(room.furniture[0], center=None, rotation=degrees)
    said = answers.answer("furnish", body(replace(room, furniture=(given, *room.furniture[1:])), movable=[0]))
    assert [choice["furniture"][0]["rotation"] for choice in said["choices"]] == [degrees] * len(said["choices"])
    assert said["choices"]


def test_an_outline_that_crosses_itself_is_told_in_words(answers):
    crossed = room_to_dict(ROOMS[0]) | {"outline": [[0, 0], [3, 3], [3, 0], [0, 3]]}
    with pytest.raises(InputError, match=r"^The outline crosses itself$"):
        answers.answer("look", json.dumps({"room": crossed}).encode())


@pytest.mark.parametrize(
    ("changed", "match"),
    [
        ({"movable": None}, "movable: expected a list"),
        ({"movable": [True]}, "movable: expected an index"),
        ({"movable": [99]}, "movable: expected an index"),
        ({"movable": []}, "nothing to furnish; unlock or add some furniture"),
        ({"movable": [0], "seed": "x"}, "seed"),
        ({"room": {}}, "id: missing"),
    ],
)
def test_what_is_wrong_with_a_question_is_said_in_a_line(answers, changed, match):
    asked = {"room": room_to_dict(ROOMS[0])} | changed
    with pytest.raises(InputError, match=match):
        answers.answer("furnish", json.dumps(asked).encode())


def test_rooms_that_would_take_long_are_refused(answers):
    wide = {"id": "a", "room_type": "study", "outline": [[0, 0], [30, 0], [30, 3], [0, 3]]}
    wide |= {"doors": [], "windows": [], "furniture": []}
    with pytest.raises(InputError, match=r"at most 25 m; got 30\.4 by 3\.4 m"):
        answers.answer("look", json.dumps({"room": wide}).encode())
    full = room_to_dict(ROOMS[0]) | {"furniture": 41 * [{"category": "a", "size": [1, 1]}], "target": 0}
    with pytest.raises(InputError, match="at most 40 pieces"):
        answers.answer("look", json.dumps({"room": full}).encode())
    with pytest.raises(InputError, match="at most 200 kB"):
        answers.answer("look", b"[" * 300_000)
