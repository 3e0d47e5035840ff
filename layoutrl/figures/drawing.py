"""Drawings of a room: SVG in layers for the web and for print, to scale; PNG; and DXF for CAD.

Faults, pairs (index, fault) as `faults` returns them, are named at their items, which are hatched in SVG and PNG.
Items without a place are named above the room. Below the room are a bar of one metre, the size of the floor and the
room's id, but not in DXF, which has true sizes. Lengths are metres; y points up in DXF and down in SVG.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from html import escape
from pathlib import Path

import numpy as np
from matplotlib import style
from matplotlib.figure import Figure

from layoutrl import InputError
from layoutrl.env.render import BLACK, DOOR, OPENINGS, color_of
from layoutrl.figures import (
    HALO,
    MARK,
    NO_MATH,
    ORANGE,
    STYLE,
    Box,
    any_script,
    draw_item,
    draw_room,
    front,
    has_front,
    in_drawing_order,
    middle,
    name_boxes,
    rgb,
    slope,
)
from layoutrl.rooms.doors import drawn_leaves
from layoutrl.rooms.room import Item, Point, Room

Wrong = Iterable[tuple[int, str]]  # (index of the item, its fault or oddity), as `faults` returns them

MARGIN = 0.1  # metres around the walls
LINE = 0.2  # metres: the height of a line of text
FOOT = 0.65  # metres below the room, for the bar, the size of the floor and the room's id
PRINTED = 40  # millimetres per metre in SVG: 1:25
LETTERS = 0.05, 0.13  # metres: the least and the greatest height of a name
HALL = 7.0  # metres: in longer rooms letters are larger in proportion
ARC = 18  # straight lines for the arc of a door's leaf
POINTS = 1.6 * 72  # points per metre in PNG
DOTS = 150  # per inch in PNG: 240 per metre
LARGEST_PNG = 8000  # pixels of its longer side: larger halls have fewer dots
WIDE = 0.6  # width of a letter, as a share of its height
NOT_IN_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
MIDDLE = 5  # a DXF text's attachment point: its middle
ACI = {"A-WALL": 7, "A-DOOR": 3, "A-GLAZ": 5, "A-FURN": 8}  # layers of a DXF, and their AutoCAD colours


def draw(room: Room, wrong: Wrong, path: Path | str) -> None:
    """Write a drawing in the format of the suffix: .svg, .png, or .dxf, which needs ezdxf.

    Items that are `wrong` are hatched, as of `faults(room)` or `Answer.wrong[n]`; [] for none.
    A file that is there is overwritten. Raises InputError for any other suffix.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".svg", ".png", ".dxf"):
        raise InputError(f"path: expected a file that ends in .svg, .png or .dxf; got {path}")
    if suffix == ".svg":
        path.write_text(svg(room, wrong), encoding="utf-8", newline="\n")
    elif suffix == ".png":
        png(room, wrong, path)
    else:
        dxf(room, wrong, path)


def svg(room: Room, wrong: Wrong = ()) -> str:
    """Return a drawing as SVG. Its user units are metres, and each layer is a <g>.

    The layers are floor, walls, openings, leaves of doors, furniture, labels and scale. Each item is a <g> with its
    index as data-id, its data-category, and its data-faults, if it has some.
    """
    x0, y0, x1, y1 = sheet(room)
    left, width, height = x0 + MARGIN, x1 - x0, y1 - y0
    coarse = _coarse(room)
    faults, items, floor_size = _by_item(wrong), in_drawing_order(room), _size(room)
    boxes = name_boxes(items)
    floor = " ".join(f"M{_points(ring)}Z" for ring in (room.outline, *room.holes))
    layers = {
        "floor": [f'<path d="{floor}" fill="#fff" fill-rule="evenodd"/>'],
        "walls": [f'<polygon points="{_points(wall)}" fill="{_hex(BLACK)}"/>' for wall in room.walls],
        "openings": [
            f'<polygon points="{_points(opening.polygon)}" fill="#fff" stroke="{_hex(OPENINGS[opening.kind])}" '
            f'stroke-width=".02" data-kind="{opening.kind}"/>'
            for opening in room.openings
        ],
        "leaves": [
            f'<path d="M{_points(leaf)}" fill="none" stroke="{_hex(DOOR)}" stroke-width=".01"/>'
            for leaf in _leaves(room)
        ],
        "furniture": [_item(k, item, faults[k]) for k, item in items],
        "labels": [
            _label(item, boxes.get(k, item.footprint.bounds), faults[k], coarse)
            for k, item in items
            if k in boxes or faults[k]
        ],
        "scale": [
            f'<path d="M{_points(_metre(x0, y0))}" fill="none" stroke="#000" stroke-width=".02"/>',
            _text("1 m", left + 1.08, y0 + MARGIN + 2 * LINE, LETTERS[1]),
            _text(floor_size, left, y0 + MARGIN + LINE, _letters([floor_size], width - 2 * MARGIN)),
            _text(room.id, left, y0 + MARGIN, _letters([room.id], width - 2 * MARGIN)),
        ],
    }
    if absent := _not_placed(room):
        letters = min(0.9 * MARGIN, _letters([absent], width - 2 * MARGIN))
        layers["labels"].append(_text(absent, left, y1 - 0.85 * MARGIN, letters))
    groups = [
        "\n".join([f'<g class="{name}" inkscape:groupmode="layer" inkscape:label="{name}">', *shapes, "</g>"])
        for name, shapes in layers.items()
    ]
    return "\n".join(
        [
            '<svg xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" '
            f'viewBox="{_number(x0)} {_number(-y1)} {_number(width)} {_number(height)}" '
            f'width="{_number(PRINTED * width)}mm" height="{_number(PRINTED * height)}mm" font-family="sans-serif">',
            f"<title>{_written(room.id)}</title>",
            '<defs><pattern id="fault" width=".1" height=".1" patternUnits="userSpaceOnUse" '
            f'patternTransform="rotate(45)"><path d="M0 0V.1" stroke="{ORANGE}" stroke-width=".04"/></pattern></defs>',
            *groups,
            "</svg>\n",
        ]
    )


def png(room: Room, wrong: Wrong, path: Path) -> None:
    """Write the same drawing as PNG."""
    x0, y0, x1, y1 = sheet(room)
    with style.context([STYLE, NO_MATH]), any_script():
        figure = Figure(figsize=(POINTS / 72 * (x1 - x0), POINTS / 72 * (y1 - y0)))
        figure.set_layout_engine("none")
        axes = figure.add_axes((0, 0, 1, 1))
        for leaf in _leaves(room):
            axes.plot(*leaf.T, color=rgb(DOOR), linewidth=0.8, zorder=0)
        draw_room(axes, replace(room, target=None), names=7, outlined=True)
        boxes = name_boxes(in_drawing_order(room))
        for k, faults in _by_item(wrong).items():
            item = room.furniture[k]
            if item.center is not None:
                draw_item(axes, item, item.center, fill=False, hatch="////", edgecolor=ORANGE, linewidth=1.5)
                said = "\n".join(faults if k in boxes else [item.category, *faults])
                box = boxes.get(k, item.footprint.bounds)
                (x, y), turned = middle(box), slope(box)
                x, y, across, up = (x + 0.12, y, "left", "center") if turned else (x, y - 0.12, "center", "top")
                axes.text(x, y, said, fontsize=6, weight="bold", rotation=turned, ha=across, va=up, path_effects=HALO)
        absent, width = _not_placed(room), x1 - x0 - 2 * MARGIN
        axes.text(x0 + MARGIN, y1, absent, fontsize=min(6, POINTS * _letters([absent], width)), va="top")
        axes.plot(*np.transpose(_metre(x0, y0)), color="black", linewidth=1)
        axes.text(x0 + MARGIN + 1.08, y0 + MARGIN + 2 * LINE, "1 m", fontsize=7)
        for lines_up, said in enumerate((room.id, _size(room))):
            letters = min(7, POINTS * _letters([said], width))
            axes.text(x0 + MARGIN, y0 + MARGIN + lines_up * LINE, said, fontsize=letters)
        axes.set(xlim=(x0, x1), ylim=(y0, y1))
        figure.savefig(path, dpi=min(DOTS, LARGEST_PNG / max(figure.get_size_inches())))


def dxf(room: Room, wrong: Wrong, path: Path) -> None:
    """Write a drawing for CAD: closed polylines and circles, y up, the unit a metre.

    It needs ezdxf, the extra `dxf`. Raises ImportError without it.
    """
    from ezdxf import units
    from ezdxf.filemanagement import new

    document = new("R2010", units=units.M)
    for name, color in ACI.items():
        document.layers.add(name, color=color)
    space, faults = document.modelspace(), _by_item(wrong)
    for wall in room.walls:
        space.add_lwpolyline(wall, close=True, dxfattribs={"layer": "A-WALL"})
    for opening in room.openings:
        layer = "A-DOOR" if opening.kind == "door" else "A-GLAZ"
        space.add_lwpolyline(opening.polygon, close=True, dxfattribs={"layer": layer})
    for leaf in _leaves(room):
        space.add_lwpolyline(leaf.tolist(), dxfattribs={"layer": "A-DOOR"})
    for k, item in in_drawing_order(room):
        assert item.center is not None
        if item.form == "circle":
            space.add_circle(item.center, item.size[0] / 2, dxfattribs={"layer": "A-FURN"})
        else:
            space.add_lwpolyline(_corners(item), close=True, dxfattribs={"layer": "A-FURN"})
        if has_front(item):
            start, end = front(item, item.center).tolist()
            space.add_line(start, end, dxfattribs={"layer": "A-FURN"})
        looks = {"layer": "A-FURN", "insert": item.center, "char_height": LETTERS[1], "attachment_point": MIDDLE}
        space.add_mtext("\\P".join([_plain(item.category), *faults[k]]), dxfattribs=looks)
    if absent := _not_placed(room):
        x0, _, _, y1 = room.envelope.bounds
        looks = {"layer": "A-FURN", "insert": (x0, y1 + 2 * LETTERS[1]), "char_height": LETTERS[1]}
        space.add_mtext(_plain(absent), dxfattribs=looks)
    document.saveas(path)


def _plain(text: str) -> str:
    """Escape backslashes, braces and carets, with which formatting begins in MTEXT of a DXF."""
    return re.sub(r"[\\{}]", r"\\\g<0>", text).replace("^", "^ ")


def sheet(room: Room) -> tuple[float, float, float, float]:
    """What a drawing shows: (x0, y0, x1, y1) of the room with its walls, and what is around and below it."""
    x0, y0, x1, y1 = room.envelope.buffer(MARGIN).bounds
    return x0, y0 - FOOT, x1, y1


def _metre(x0: float, y0: float) -> list[Point]:
    """Return the bar of one metre, with an upright at each end, for a sheet whose lower left corner is (x0, y0)."""
    left, low = x0 + MARGIN, y0 + MARGIN + 2 * LINE
    right, high = left + 1, low + MARGIN
    return [(left, high), (left, low), (right, low), (right, high)]


def _size(room: Room) -> str:
    """Return the size of the floor as text: the sides of its bounding box, and its area."""
    x0, y0, x1, y1 = room.indoor.bounds
    return f"{x1 - x0:.2f} by {y1 - y0:.2f} m, {room.indoor.area:.1f} m²"


def _by_item(wrong: Wrong) -> dict[int, list[str]]:
    faults: dict[int, list[str]] = defaultdict(list)
    for k, fault in wrong:
        faults[k].append(fault)
    return faults


def _not_placed(room: Room) -> str:
    """Which items have no place, in words; nothing where all have one."""
    names = [item.category.replace("_", " ") for item in room.furniture if item.center is None]
    return f"not placed: {', '.join(names)}" if names else ""


def _corners(item: Item) -> list[Point]:
    return [(float(x), float(y)) for x, y in item.footprint.exterior.coords[:-1]]


def _item(index: int, item: Item, faults: Sequence[str]) -> str:
    assert item.center is not None
    x, y = item.center

    def shape(looks: str) -> str:
        if item.form == "circle":
            return f'<circle cx="{_number(x)}" cy="{_number(-y)}" r="{_number(item.size[0] / 2)}" {looks}/>'
        return f'<polygon points="{_points(_corners(item))}" {looks}/>'

    category = _written(item.category)
    parts = [f"<title>{category}{': ' if faults else ''}{_written(', '.join(faults))}</title>"]
    parts.append(shape(f'fill="{_hex(color_of(item.category))}" stroke="#000" stroke-width=".01"'))
    if has_front(item):
        parts.append(f'<path d="M{_points(front(item, item.center))}" stroke="#000" stroke-width=".015"/>')
    if faults:
        parts.append(shape(f'fill="url(#fault)" stroke="{ORANGE}" stroke-width=".03"'))
    wrong = f' data-faults="{_written(", ".join(faults))}"' if faults else ""
    return f'<g data-id="{index}" data-category="{category}"{wrong}>{"".join(parts)}</g>'


def _label(item: Item, box: Box, faults: Sequence[str], coarse: float) -> str:
    """Return an item's label in a box: its category, one word per line, and below it the faults.

    The letters are as large as fit in the box, in that of a whole item behind the line to its front, within the limits
    of `_letters`. The label is turned by a quarter where that makes them much larger.
    """
    x0, y0, x1, y1 = box
    across, up = x1 - x0, y1 - y0
    if has_front(item) and box == item.footprint.bounds:
        ahead = abs(np.cos(np.radians(item.degrees))) > 0.5**0.5  # it faces along x rather than y
        across, up = (MARK * across, up) if ahead else (across, MARK * up)
    x, y = middle(box)
    y = -y
    words = item.category.replace("_", " ").split()
    said = [*words, *faults]
    size, turned = (_letters(said, *space, coarse) for space in ((across, up), (up, across)))
    turn = ""
    if turned > 1.2 * size:
        size, turn = turned, f' transform="rotate(-90 {_number(x)} {_number(y)})"'
    top = y - size * len(said) / 2
    lines = [
        f'<tspan x="{_number(x)}" y="{_number(top + (n + 0.8) * size)}"{weight}>{_written(text)}</tspan>'
        for n, (text, weight) in enumerate([*((w, "") for w in words), *((f, ' font-weight="bold"') for f in faults)])
    ]
    halo = f'stroke="#fff" stroke-width="{_number(size / 5)}" paint-order="stroke"' if faults else ""
    return f'<text font-size="{_number(size)}" text-anchor="middle"{turn} {halo}>{"".join(lines)}</text>'


def _letters(lines: Sequence[str], width: float, height: float = np.inf, coarse: float = 1.0) -> float:
    """Return the height of letters in metres at which the lines fit width and height, within LETTERS times `coarse`."""
    least, most = LETTERS[0] * coarse, LETTERS[1] * coarse
    return min(max(min(width / (WIDE * max(1, *map(len, lines))), height / len(lines)), least), most)


def _leaves(room: Room) -> list[np.ndarray]:
    """Return for each door with a leaf the line (n, 2) along the open leaf and the arc to where it is shut."""
    return [np.vstack([leaf.hinge, leaf.arc(ARC)[::-1]]) for leaf in drawn_leaves(room) if leaf]


def _coarse(room: Room) -> float:
    """Return how many times larger letters are than LETTERS: a screen shows a hall as small as a room."""
    x0, y0, x1, y1 = room.envelope.bounds
    return max(1.0, max(x1 - x0, y1 - y0) / HALL)


def _text(text: str, x: float, y: float, size: float) -> str:
    return f'<text x="{_number(x)}" y="{_number(-y)}" font-size="{_number(size)}">{_written(text)}</text>'


def in_xml(text: str) -> str:
    """Replace the characters that XML cannot hold, such as control characters, by U+FFFD."""
    return NOT_IN_XML.sub("\N{REPLACEMENT CHARACTER}", text)


def _written(text: str) -> str:
    return escape(in_xml(text))


def _points(ring: Iterable[Point]) -> str:
    return " ".join(f"{_number(x)},{_number(-y)}" for x, y in ring)


def _number(metres: float) -> str:
    """Format metres to a tenth of a millimetre, as far as 100 km from the origin."""
    return f"{round(float(metres), 4) + 0.0:.9g}"


def _hex(color: tuple[int, int, int]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*color)
