"""Drawings to true size: what can be read out of them is the room."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from PIL import Image
from shapely.geometry import LineString, Point, Polygon, box

from layoutrl import InputError
from layoutrl.env.render import DOOR, WINDOW, color_of
from layoutrl.figures import draw_item, front
from layoutrl.figures.drawing import WIDE, draw, sheet, svg
from layoutrl.rooms.documents import room_from_dict
from layoutrl.rooms.doors import drawn_leaves
from layoutrl.rooms.room import Item, Room
from tests.builders import rectangle, rectangular_room, room_of, rooms
from tests.rooms.test_documents import document

SVG = "{http://www.w3.org/2000/svg}"
TENTH = 1e-4  # metres: coordinates are written to a tenth of a millimetre


def layers(drawing: str) -> dict[str, ElementTree.Element]:
    return {str(layer.get("class")): layer for layer in ElementTree.fromstring(drawing).findall(f"{SVG}g")}


def outline(shape: ElementTree.Element) -> Polygon:
    """In metres, y up."""
    if shape.tag == f"{SVG}circle":
        x, y, radius = (float(shape.get(name, "nan")) for name in ("cx", "cy", "r"))
        return Point(x, -y).buffer(radius, quad_segs=64)
    corners = np.array([pair.split(",") for pair in shape.get("points", "").split()], dtype=float)
    return Polygon(corners * (1, -1))


@given(rooms())
def test_svg_has_the_shapes_of_the_room_in_metres_a_layer_a_kind(room: Room) -> None:
    drawn = layers(svg(room))
    assert list(drawn) == ["floor", "walls", "openings", "leaves", "furniture", "labels", "scale"]
    for shape, wall in zip(drawn["walls"], room.wall_shapes, strict=True):
        assert outline(shape).hausdorff_distance(wall) < TENTH
    for shape, opening in zip(drawn["openings"], room.openings, strict=True):
        assert shape.get("data-kind") == opening.kind
        assert outline(shape).hausdorff_distance(opening.shape) < TENTH
    for shape, leaf in zip(drawn["leaves"], filter(None, drawn_leaves(room)), strict=True):
        way = np.array([pair.split(",") for pair in shape.get("d", "")[1:].split()], dtype=float) * (1, -1)
        assert np.allclose(way[[0, 1, -1]], [leaf.hinge, leaf.open, leaf.shut], atol=TENTH)
        assert np.allclose(np.hypot(*(way[1:] - leaf.hinge).T), np.hypot(*(leaf.shut - leaf.hinge)), atol=1e-3)
    items = {int(group.get("data-id", "")): group for group in drawn["furniture"]}
    assert sorted(items) == [k for k, item in enumerate(room.furniture) if item.center is not None]
    for k, group in items.items():
        assert group.get("data-category") == room.furniture[k].category
        (first, *_) = (shape for shape in group if shape.tag in (f"{SVG}polygon", f"{SVG}circle"))
        assert outline(first).hausdorff_distance(room.furniture[k].footprint) < 0.01


@given(rooms())
def test_svg_shows_the_whole_room_to_scale(room: Room) -> None:
    drawing = ElementTree.fromstring(svg(room))
    x, y, width, height = map(float, drawing.get("viewBox", "").split())
    assert np.allclose((x, -y - height, x + width, -y), sheet(room), rtol=0, atol=2 * TENTH)
    assert box(*sheet(room)).contains(room.envelope)
    assert drawing.get("width", "").endswith("mm")
    ratio = float(drawing.get("width", "")[:-2]) / float(drawing.get("height", "")[:-2])
    assert ratio == pytest.approx(width / height, rel=0.01)


@given(st.floats(-900, 900), st.floats(-900, 900))
def test_svg_is_as_exact_far_from_the_origin_and_writes_no_zero_that_says_nothing(x: float, y: float) -> None:
    room = room_of(rectangle(x, y, x + 4, y + 3), Item("bed", (1.0, 1.0), (x + 2, y + 1)))
    drawing = svg(room)
    left, top, width, height = map(float, ElementTree.fromstring(drawing).get("viewBox", "").split())
    assert np.allclose((left, -top - height, left + width, -top), sheet(room), rtol=0, atol=2 * TENTH)
    for shape, wall in zip(layers(drawing)["walls"], room.wall_shapes, strict=True):
        assert outline(shape).hausdorff_distance(wall) < TENTH
    numbers = re.findall(r"[-\d.e]+", " ".join(re.findall(r'(?:points|viewBox)="([^"]*)"', drawing)))
    assert not [number for number in numbers if not re.fullmatch(r"-?\d+(\.\d{0,3}[1-9])?", number)]


def test_what_is_wrong_is_marked_and_named_on_the_item_alone() -> None:
    room = rectangular_room()
    drawn = layers(svg(room, [(0, "overlaps"), (0, "out of reach")]))
    faulty, *others = drawn["furniture"]
    assert faulty.get("data-faults") == "overlaps, out of reach"
    assert all(group.get("data-faults") is None for group in others)
    said = ["".join(label.itertext()) for label in drawn["labels"]]
    assert [("overlaps" in text, "out of reach" in text) for text in said] == [(True, True)] + [(False, False)] * len(
        others
    )


def test_names_of_the_users_own_are_no_markup() -> None:
    room = rectangular_room()
    assert room.furniture
    strange = replace(room.furniture[0], category='<b onclick="x">&')
    drawn = layers(svg(replace(room, id="<i>", furniture=(strange,)), [(0, "<fault>")]))
    (group,) = drawn["furniture"]
    assert group.get("data-category") == strange.category


def test_a_drawing_of_no_known_format_is_refused_and_not_written_as_another(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"^path: expected a file that ends in \.svg, \.png or \.dxf; got .*room\.pdf$"
    ):
        draw(rectangular_room(), [], str(tmp_path / "room.pdf"))
    assert not [*tmp_path.iterdir()]


def test_suffixes_are_read_in_capitals_too(tmp_path: Path) -> None:
    for name in ("room.SVG", "room.Png"):
        draw(rectangular_room(), [], tmp_path / name)
    assert layers((tmp_path / "room.SVG").read_text())["furniture"] is not None


def test_a_dollar_in_a_name_is_a_dollar(tmp_path: Path) -> None:
    room = rectangular_room()
    dear = replace(room, id=r"$\frac$", furniture=(replace(room.furniture[0], category=r"$\alpha$ bed $\frac$"),))
    draw(dear, [(0, r"$\frac$")], tmp_path / "room.png")


def test_what_has_no_place_is_not_drawn(tmp_path: Path) -> None:
    room = replace(rectangular_room(), furniture=(Item("bed", (2.0, 1.5), None, None),))
    assert not len(layers(svg(room))["furniture"])
    for suffix in ("svg", "png"):
        draw(room, [(0, "not placed")], tmp_path / f"room.{suffix}")


def test_png_has_the_proportions_of_the_room(tmp_path: Path) -> None:
    room = rectangular_room()
    draw(room, [(0, "overlaps")], tmp_path / "room.png")
    x0, y0, x1, y1 = sheet(room)
    with Image.open(tmp_path / "room.png") as picture:
        assert picture.size[0] / picture.size[1] == pytest.approx((x1 - x0) / (y1 - y0), rel=0.01)


def test_png_shows_the_leaf_of_a_door(tmp_path: Path) -> None:
    room = room_from_dict(document(furniture=[]))
    (leaf,) = drawn_leaves(room)
    assert leaf
    draw(room, [], tmp_path / "room.png")
    x0, y0, x1, y1 = sheet(room)
    x, y = leaf.open - 0.2 * (leaf.open - leaf.hinge)
    with Image.open(tmp_path / "room.png") as picture:
        column, row = (x - x0) / (x1 - x0) * picture.width, (y1 - y) / (y1 - y0) * picture.height
        near = picture.convert("RGB").crop((int(column) - 3, int(row) - 3, int(column) + 4, int(row) + 4))
        assert min(abs(np.array(near) - np.array(DOOR)).sum(-1).ravel()) < 120


def test_openings_are_white_between_lines_of_their_colour(tmp_path: Path) -> None:
    room = room_from_dict(document(furniture=[]))
    (door, window), (x0, y0, x1, y1) = room.openings, sheet(room)
    drawn = [(shape.get("fill"), shape.get("stroke")) for shape in layers(svg(room))["openings"]]
    assert drawn == [("#fff", "#00a03c"), ("#fff", "#285ae6")]
    draw(room, [], tmp_path / "room.png")
    with Image.open(tmp_path / "room.png") as picture:
        for opening, color in ((door, DOOR), (window, WINDOW)):
            (left, low, right, high), middle = opening.shape.bounds, opening.shape.centroid
            across = (middle.x, low) if right - left > high - low else (left, middle.y)
            for (x, y), expected in (((middle.x, middle.y), (255, 255, 255)), (across, color)):
                column, row = (x - x0) / (x1 - x0) * picture.width, (y1 - y) / (y1 - y0) * picture.height
                assert picture.convert("RGB").getpixel((int(column), int(row))) == expected


@given(room=rooms())
def test_dxf_has_the_shapes_of_the_room_in_metres_a_layer_a_kind(
    tmp_path_factory: pytest.TempPathFactory, room: Room
) -> None:
    ezdxf = pytest.importorskip("ezdxf")
    file = tmp_path_factory.mktemp("dxf") / "room.dxf"
    draw(room, [], file)
    document = ezdxf.readfile(file)
    assert document.units == ezdxf.units.M
    assert not document.audit().errors
    open_leaves, shapes = [], {layer: [] for layer in ("A-WALL", "A-DOOR", "A-GLAZ", "A-FURN")}
    for line in document.modelspace().query("LWPOLYLINE"):
        if line.closed:
            shapes[line.dxf.layer].append(Polygon([(x, y) for x, y, *_ in line]))
        else:
            open_leaves.append(LineString([(x, y) for x, y, *_ in line]))
    circles = [circle.dxf.radius * 2 for circle in document.modelspace().query("CIRCLE")]
    placed = [item for item in room.furniture if item.center is not None]
    assert sorted(circles) == sorted(item.size[0] for item in placed if item.form == "circle")
    expected = {
        "A-WALL": room.wall_shapes,
        "A-DOOR": [door.shape for door in room.doors],
        "A-GLAZ": [window.shape for window in room.windows],
        "A-FURN": [item.footprint for item in placed if item.form != "circle"],
    }
    for layer, polygons in expected.items():
        assert sorted(shape.area for shape in shapes[layer]) == pytest.approx(sorted(p.area for p in polygons))
    for line, leaf in zip(open_leaves, filter(None, drawn_leaves(room)), strict=True):
        assert line.hausdorff_distance(leaf.swept.boundary) < np.hypot(*(leaf.shut - leaf.hinge))
        assert np.allclose([line.coords[0], line.coords[-1]], [leaf.hinge, leaf.shut], atol=TENTH)
    names = [re.split(r"\\P", text.text)[0] for text in document.modelspace().query("MTEXT")]
    assert sorted(names) == sorted(item.category for item in placed)


def letters(room: Room) -> list[tuple[float, bool]]:
    """How high the letters of each label are, in metres, and whether it is turned."""
    return [(float(t.get("font-size", "")), "rotate" in t.get("transform", "")) for t in layers(svg(room))["labels"]]


def test_a_label_is_within_its_item_turned_in_a_narrow_one_and_larger_in_a_hall() -> None:
    shelf = Item("bookcase", (0.3, 1.2), (0.15, 1.5), 0.0)
    (high, turned), (other, upright) = letters(
        replace(rectangular_room(4, 3), furniture=(shelf, replace(shelf, center=(2, 0.15), rotation=90.0)), target=None)
    )
    assert (turned, upright) == (True, False)
    assert high == other
    assert WIDE * len("bookcase") * high < 1.2
    ((in_hall, _),) = letters(replace(rectangular_room(20, 14), furniture=(shelf,), target=None))
    assert in_hall > 1.5 * high
    ((narrow, _),) = letters(
        replace(rectangular_room(4, 3), furniture=(replace(shelf, size=(0.08, 0.9)),), target=None)
    )
    assert narrow <= 0.08


def seated() -> Room:
    """A room of 4 by 3 m, a chair under a table, with 20 cm beside it, and a table on the left of a rug."""
    furniture = (
        Item("rug", (2.0, 1.0), (1.5, 0.6), 0.0),
        Item("coffee_table", (0.6, 0.6), (1.4, 0.6), 0.0),
        Item("chair", (0.5, 0.5), (1.05, 2.0), 0.0, tucked=True),
        Item("table", (1.0, 1.6), (1.5, 2.0), 0.0),
    )
    return replace(rectangular_room(4, 3), furniture=furniture, target=None)


def test_a_label_is_where_its_item_is_not_covered() -> None:
    room = seated()
    where = {
        "".join(line.text or "" for line in label): Point(float(label[0].get("x", "")), -float(label[0].get("y", "")))
        for label in layers(svg(room))["labels"]
    }
    for said, visible in (("chair", box(0.8, 1.75, 1.0, 2.25)), ("rug", box(0.5, 0.1, 1.1, 1.1))):
        assert visible.contains(where[said])
    covered = replace(room.furniture[2], center=(1.27, 2.0))  # 2 cm of it are left
    hidden = replace(room, furniture=(covered, room.furniture[3]))
    for faults, said in (([], ["table"]), ([(0, "out of reach")], ["chairout of reach", "table"])):
        assert ["".join(label.itertext()) for label in layers(svg(hidden, faults))["labels"]] == said


@pytest.mark.parametrize(("category", "form"), [("table", "rectangle"), ("armchair", "circle"), ("bed", "rectangle")])
def test_what_has_no_front_is_drawn_without_one(category: str, form: Any, tmp_path: Path) -> None:
    ezdxf = pytest.importorskip("ezdxf")
    item = Item(category, (1.0, 1.0), (2.0, 1.5), 0.0, form)
    room = replace(rectangular_room(4, 3), furniture=(item,), target=None)
    ((group,), axes) = layers(svg(room))["furniture"], Figure().add_subplot()
    draw(room, [], tmp_path / "room.dxf")
    lines = ezdxf.readfile(tmp_path / "room.dxf").modelspace().query("LINE")
    drawn = [len(group.findall(f"{SVG}path")), len(lines), len(draw_item(axes, item, (2.0, 1.5))) - 1]
    assert drawn == [int(category == "bed")] * 3


def test_a_hall_is_no_larger_a_picture_than_a_computer_holds(tmp_path: Path) -> None:
    draw(rectangular_room(90, 30), [], tmp_path / "hall.png")
    with Image.open(tmp_path / "hall.png") as picture:
        assert 7900 < picture.width <= 8000
        assert picture.height == pytest.approx(picture.width / 3, rel=0.05)


def test_a_name_is_no_formatting_in_dxf(tmp_path: Path) -> None:
    ezdxf = pytest.importorskip("ezdxf")
    furniture = (Item("a\\Pb{\\C1;c}", (1, 1), (2, 1)), Item("{d^Je}", (1, 1)))
    draw(replace(rectangular_room(4, 3), furniture=furniture, target=None), [(0, "overlaps")], tmp_path / "room.dxf")
    texts = ezdxf.readfile(tmp_path / "room.dxf").modelspace().query("MTEXT")
    assert [text.plain_text() for text in texts] == ["a\\Pb{\\C1;c}\noverlaps", "not placed: {d^Je}"]


def test_png_shows_no_front_of_a_chair_on_its_table(tmp_path: Path) -> None:
    room = seated()
    draw(room, [], tmp_path / "room.png")
    x0, y0, x1, y1 = sheet(room)
    with Image.open(tmp_path / "room.png") as picture:
        column, row = (1.26 - x0) / (x1 - x0) * picture.width, (y1 - 2.0) / (y1 - y0) * picture.height
        there = picture.convert("RGB").crop((int(column) - 2, int(row) - 4, int(column) + 3, int(row) + 5))
        assert {tuple(pixel) for pixel in np.array(there).reshape(-1, 3)} == {color_of("table")}


@pytest.mark.parametrize("rotation", [0.0, 90.0, 180.0, 270.0])
def test_the_line_to_the_front_strikes_through_no_label(rotation: float) -> None:
    wardrobe = Item("wardrobe", (0.6, 0.9), (2.0, 1.5), rotation)
    ((high, turned),) = letters(replace(rectangular_room(4, 3), furniture=(wardrobe,), target=None))
    along = turned == (rotation % 180 == 0)  # the name runs along the front, not towards it
    assert (high if along else WIDE * len("wardrobe") * high) <= 0.7 * 0.6 + TENTH


def test_the_line_to_the_front_strikes_through_no_label_of_what_is_partly_covered() -> None:
    room = seated()
    labels = {"".join(label.itertext()): label for label in layers(svg(room))["labels"]}
    high = float(labels["rug"].get("font-size", ""))
    ((x, y),) = {(float(line.get("x", "")), -float(line.get("y", ""))) for line in labels["rug"]}
    wide = WIDE * len("rug") * high
    name = box(x - wide / 2, y - 0.2 * high, x + wide / 2, y + 0.8 * high)
    assert not name.intersects(LineString(front(room.furniture[0], (1.5, 0.6))))


@pytest.mark.parametrize("width", [1.5, 3.0, 6.0])
def test_the_name_of_a_narrow_room_fits_on_its_sheet(width: float) -> None:
    room = replace(rectangular_room(width, 3.0, Item("bed", (2.0, 1.0)), target=None), id="flat 12, the second bedroom")
    drawing = svg(room)
    x0, _, x1, _ = sheet(room)
    texts = {text.text: text for text in ElementTree.fromstring(drawing).iter(f"{SVG}text")}
    for said in ("1 m", room.id, "not placed: bed", f"{width:.2f} by 3.00 m, {3 * width:.1f} m²"):
        text = texts[said]
        x, size = float(text.get("x", "nan")), float(text.get("font-size", "nan"))
        assert x0 <= x
        assert x + WIDE * size * len(said) <= x1 + TENTH


@given(st.characters(exclude_categories=["Cs", "Cc"], exclude_characters="\ufffe\uffff") | st.sampled_from("\t\n\r"))
def test_a_name_of_any_characters_can_be_read_from_a_drawing(character: str) -> None:
    assert name_of(svg(room_from_dict(document(id=f"a{character}z")))) == f"a{character}z".replace("\r", "\n")


@given(st.sampled_from("\x00\x1b\ufffe\uffff"))
def test_of_a_name_what_xml_cannot_hold_is_replaced(character: str) -> None:
    assert name_of(svg(room_from_dict(document(id=f"a{character}z")))) == "a\ufffdz"


def name_of(drawing: str) -> str | None:
    """As XML reads it, by which lines end with \\n."""
    return next(ElementTree.fromstring(drawing).iter(f"{SVG}title")).text
