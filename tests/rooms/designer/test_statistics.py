"""Are tatami rooms and bedrooms as large, their doors and windows as wide, as those that the authors published?

The bands are the 10%, 50% and 90% quantiles of the authors' rooms, in metres and square metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from layoutrl.rooms.designer.generator import design_room
from layoutrl.rooms.room import Opening, Room
from layoutrl.rooms.sources.designer_rooms import read

REAL = Path(__file__).parents[4] / "shared" / "data" / "designer_rooms"
real_data = pytest.mark.skipif(not REAL.is_dir(), reason=f"the designers' rooms are not in {REAL}")

ROOMS = 300
# Of each quantile; unsourced. Wide for areas, where the table's (10.3, 14.3, 21.1 for bedrooms) and those of the rooms
# that can be read (10.8, 12.9, 16.3) lie far apart themselves.
SLACK = {"short": 0.15, "long": 0.25, "area": 3.0}
QUANTILES = (0.1, 0.5, 0.9)
PUBLISHED = {
    "tatami": {"short": (2.60, 2.95, 3.20), "long": (2.95, 3.30, 3.50), "area": (8.4, 9.6, 11.2)},
    "bedroom": {"short": (2.7, 3.2, 3.65), "long": (3.75, 4.25, 5.75), "area": (10.3, 14.3, 21.1)},
}
DOORS = {"tatami": (0.9, 0.9), "bedroom": (0.8, 1.25)}  # narrowest and widest
WINDOWS = {"tatami": (1.2, 1.2, 1.5), "bedroom": (1.5, 2.1, 2.4)}


def measures(rooms: Sequence[Room]) -> dict[str, np.ndarray]:
    bounds = np.array([room.indoor.bounds for room in rooms])
    sides = bounds[:, 2:] - bounds[:, :2]
    return {"short": sides.min(1), "long": sides.max(1), "area": np.array([room.indoor.area for room in rooms])}


def widths(openings: Sequence[Opening]) -> np.ndarray:
    """The side along the wall: the longer one, as no opening is narrower than a wall is thick."""
    bounds = np.array([opening.shape.bounds for opening in openings])
    return (bounds[:, 2:] - bounds[:, :2]).max(1)


@cache
def designed(room_type: str) -> list[Room]:
    return [design_room(room_type, "train", 0, k).room for k in range(ROOMS)]


@pytest.fixture(params=["tatami", "bedroom"])
def generated(request: pytest.FixtureRequest) -> list[Room]:
    return designed(request.param)


def test_sides_and_areas(generated: list[Room]) -> None:
    kind = generated[0].room_type
    for name, values in measures(generated).items():
        assert np.quantile(values, QUANTILES) == pytest.approx(PUBLISHED[kind][name], abs=SLACK[name]), name


def test_door_widths(generated: list[Room]) -> None:
    low, high = DOORS[generated[0].room_type]
    doors = widths([room.doors[0] for room in generated])
    assert low - 1e-9 <= doors.min()
    assert doors.max() <= high + 1e-9
    assert np.median(doors) == pytest.approx(0.9)


def test_window_widths(generated: list[Room]) -> None:
    windows = widths([room.windows[0] for room in generated])
    assert np.quantile(windows, QUANTILES) == pytest.approx(WINDOWS[generated[0].room_type], abs=0.3)


def test_tatami_windows_mostly_lie_in_a_wall_beside_that_of_the_door() -> None:
    rooms = designed("tatami")
    assert np.median(widths([room.windows[0] for room in rooms])) == pytest.approx(1.2)
    beside = [lies_along_x(room.doors[0]) != lies_along_x(room.windows[0]) for room in rooms]
    assert np.mean(beside) >= 0.75


def lies_along_x(opening: Opening) -> bool:
    x0, y0, x1, y1 = opening.shape.bounds
    return bool(x1 - x0 > y1 - y0)


@real_data
def test_like_the_real_rooms_themselves(generated: list[Room]) -> None:
    kind = generated[0].room_type
    real = list({room.group: room for room in read(REAL, kind).rooms}.values())  # one layout a room
    medians = {name: np.median(values) for name, values in measures(real).items()}
    for name, values in measures(generated).items():
        assert np.median(values) == pytest.approx(medians[name], abs=SLACK[name]), name
    assert np.median(widths([room.doors[0] for room in generated])) == pytest.approx(
        np.median(widths([room.doors[0] for room in real])), abs=0.05
    )
    assert np.median(widths([room.windows[0] for room in generated])) == pytest.approx(
        np.median(widths([room.windows[0] for room in real])), abs=0.3
    )
