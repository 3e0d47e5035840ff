"""Pictures for PlanIT's networks: exact against shapely, and turned as the room is."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import torch
from shapely.affinity import affine_transform
from shapely.geometry import Polygon, box

from layoutrl.rivals.planit.canvas import (
    CATEGORY_GREY,
    COSINE,
    DOOR,
    FIXED_CHANNELS,
    FURNITURE,
    ROOM,
    SINE,
    WALL,
    WALL_GREY,
    WINDOW,
    Canvas,
    box_of,
)
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import SYMMETRIES, Item, Room
from tests.builders import rectangle, rectangular_room

SIDE = 16


def drawn(
    room: Room, centre: tuple[float, float], quarters: int = 0, mirrored: bool = False, reach: float = 4.0
) -> np.ndarray:
    categories = sorted({item.category for item in room.furniture})
    canvas = Canvas([room], categories)
    return canvas.draw(
        torch.tensor([0]),
        canvas.furniture([room.furniture]),
        torch.tensor([centre]),
        torch.tensor([quarters]),
        torch.tensor([mirrored]),
        reach=reach,
        side=SIDE,
        anchor=torch.tensor([box_of(room.furniture[0])]),
    )[0].numpy()


def share(
    shape: shapely.Geometry, centre: tuple[float, float], quarters: int, mirrored: bool, reach: float
) -> np.ndarray:
    """The share of each pixel that a shape covers, by clipping it."""
    cosine, sine = ((1, 0), (0, -1), (-1, 0), (0, 1))[quarters]  # turned back
    flip = -1 if mirrored else 1
    matrix = [cosine, -sine, flip * sine, flip * cosine]
    moved = affine_transform(affine_transform(shape, [1, 0, 0, 1, -centre[0], -centre[1]]), [*matrix, 0, 0])
    size = 2 * reach / SIDE
    pixels = [
        [box(x * size - reach, y * size - reach, (x + 1) * size - reach, (y + 1) * size - reach) for x in range(SIDE)]
        for y in range(SIDE)
    ]
    return shapely.area(shapely.intersection(np.array(pixels), moved)) / size**2


@pytest.mark.parametrize("quarters", range(4))
@pytest.mark.parametrize("mirrored", [False, True])
def test_every_channel_is_the_share_that_its_shapes_cover(quarters: int, mirrored: bool) -> None:
    rooms = [design_rooms(room_type, "train", 5, 3).rooms[2] for room_type in ("bathroom", "bedroom")]
    columns = (rectangle(1.0, 1.0, 1.4, 1.5), rectangle(2.0, 2.0, 2.5, 2.2)[::-1])  # either way around
    rooms.append(rectangular_room(item=Item("bed", (0.8, 0.5), (3.0, 0.7), 90), holes=columns))
    for room in rooms:
        centre = box_of(room.furniture[-1])[:2]
        image = drawn(room, centre, quarters, mirrored)
        frame = (centre, quarters, mirrored, 4.0)

        def shares(polygons: list[Polygon]) -> np.ndarray:
            return sum((share(p, *frame) for p in polygons), np.zeros((SIDE, SIDE)))  # noqa: B023

        items = [item.footprint.envelope for item in room.furniture]
        np.testing.assert_allclose(image[ROOM], shares([room.indoor]), atol=2e-4)
        openings = [o.shape for o in room.openings]
        walls = WALL_GREY * shares(list(room.wall_shapes)) + shares(openings)
        np.testing.assert_allclose(image[WALL], walls, atol=2e-4)
        np.testing.assert_allclose(image[DOOR], shares([o.shape for o in room.doors]), atol=2e-4)
        np.testing.assert_allclose(image[WINDOW], shares([o.shape for o in room.windows]), atol=2e-4)
        np.testing.assert_allclose(image[FURNITURE], shares(items), atol=2e-4)
        np.testing.assert_allclose(image[-1], shares(items[:1]), atol=2e-4)
        for k, category in enumerate(sorted({item.category for item in room.furniture})):
            own = [i for i, item in zip(items, room.furniture, strict=True) if item.category == category]
            np.testing.assert_allclose(image[FIXED_CHANNELS + k], CATEGORY_GREY * shares(own), atol=2e-4)


def test_a_turned_room_looks_as_the_room_does_from_a_turned_anchor() -> None:
    """What the network sees of an anchor hangs on the room's form, not on how it lies."""
    room = design_rooms("bedroom", "train", 5, 1).rooms[0]
    anchor = room.furniture[0]
    expected = drawn(room, anchor.center, int(anchor.rotation // 90))
    for quarters, mirror in SYMMETRIES:
        other = room.turned(quarters, mirror)
        image = drawn(other, other.furniture[0].center, int(other.furniture[0].rotation // 90), mirror)
        np.testing.assert_allclose(image, expected, atol=1e-4)


def test_facing_is_shown_as_it_is_in_the_picture() -> None:
    """The sine and cosine channels, from -1..1 to 0..1, in an item's middle."""
    for facing, quarters, mirrored, (sine, cosine) in (
        (0, 0, False, (0.5, 1.0)),
        (90, 0, False, (1.0, 0.5)),
        (90, 0, True, (0.0, 0.5)),
        (90, 1, False, (0.5, 1.0)),
        (0, 1, False, (0.0, 0.5)),
        (180, 0, False, (0.5, 0.0)),
    ):
        image = drawn(
            rectangular_room(item=Item("bed", (2.0, 2.0), (2.0, 1.5), facing)), (2.0, 1.5), quarters, mirrored
        )
        assert image[SINE, SIDE // 2, SIDE // 2] == pytest.approx(sine, abs=1e-6)
        assert image[COSINE, SIDE // 2, SIDE // 2] == pytest.approx(cosine, abs=1e-6)


def test_rooms_of_one_batch_do_not_meet_and_missing_furniture_is_not_drawn() -> None:
    rooms = [rectangular_room(), rectangular_room(3.0, 2.5, Item("desk", (1.2, 0.6), (1.0, 1.0), 90))]
    canvas = Canvas(rooms, ["bed", "desk"])
    furniture = canvas.furniture([[], rooms[1].furniture])
    both = canvas.draw(
        torch.tensor([0, 1]), furniture, torch.zeros(2, 2), torch.zeros(2, dtype=torch.long),
        torch.zeros(2, dtype=torch.bool), reach=4.0, side=SIDE,
    )  # fmt: skip
    assert both.shape == (2, FIXED_CHANNELS + 2, SIDE, SIDE)
    assert not both[0, FURNITURE].any()
    assert both[1, FURNITURE].sum() > 0
    alone = canvas.draw(
        torch.tensor([1]), furniture[1:], torch.zeros(1, 2), torch.zeros(1, dtype=torch.long),
        torch.zeros(1, dtype=torch.bool), reach=4.0, side=SIDE,
    )  # fmt: skip
    torch.testing.assert_close(both[1:], alone)
