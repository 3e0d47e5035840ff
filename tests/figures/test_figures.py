"""Figures: what is drawn is what is there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib import style
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from shapely.geometry import Point

from layoutrl import InputError
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.figures import (
    FAULT_MARKS,
    STYLE,
    draw_episode,
    draw_faults,
    draw_room,
    positions,
    room_legend,
    save,
    scale_bar,
)
from layoutrl.rooms.faults import faults
from layoutrl.rooms.room import Item
from tests.builders import rectangular_room

BED = Item("bed", (1.0, 0.6), (2.0, 1.5))
DESK = Item("desk", (3.0, 2.5), (0.6, 0.4))


@pytest.fixture
def room():
    return rectangular_room(4, 3, BED, others=(DESK,))


def shapes(axes):
    return [patch.get_xy().mean(0) for patch in axes.patches if isinstance(patch, Polygon)]


def test_a_room_is_drawn_with_and_without_the_item_that_moves(room):
    whole, rest = Figure().subplots(1, 2)
    draw_room(whole, room)
    draw_room(rest, room, moving=False, names=None)
    assert len(whole.patches) == len(room.walls) + len(room.openings) + 2
    assert len(rest.patches) == len(whole.patches) - 1
    assert [text.get_text() for text in whole.texts] == ["bed", "desk"]
    assert not rest.texts


def test_what_others_stand_on_is_drawn_below_them_and_chairs_below_their_table(room):
    rug, chair = Item("rug", (2.0, 2.0), (2.0, 1.5)), Item("chair", (0.5, 0.5), (2.0, 1.0), tucked=True)
    axes = Figure().subplots()
    draw_room(axes, replace(room, furniture=(*room.furniture, chair, rug, Item("desk", (1, 1), None, None))))
    assert [text.get_text() for text in axes.texts] == ["rug", "chair", "bed", "desk"]


def test_a_name_runs_along_a_narrow_item() -> None:
    wardrobe, desk, table = (
        Item("wardrobe", (0.6, 1.8), (1.0, 2.0), 0.0),
        Item("desk", (0.6, 1.2), (3.0, 2.0), 90.0),
        Item("table", (1.0, 1.0), (5.0, 2.0), 0.0),
    )
    axes = Figure().subplots()
    draw_room(axes, rectangular_room(6, 4, wardrobe, others=(desk, table)))
    assert {text.get_text(): text.get_rotation() for text in axes.texts} == {"wardrobe": 90, "desk": 0, "table": 0}


def test_what_is_wrong_with_a_layout_is_hatched_and_lettered(room):
    axes = Figure().subplots()
    chair = Item("chair", (0.5, 0.5), (2.0, 1.5))
    layout = replace(room, furniture=(*room.furniture, chair, Item("desk", (1, 1), None, None)))
    draw_faults(axes, layout)
    hatched = [patch for patch in axes.patches if patch.get_hatch()]
    named = {(k, fault) for k, fault in faults(layout) if fault in FAULT_MARKS}
    assert len(hatched) == len({k for k, _ in named}) >= 2
    assert "O" in axes.texts[0].get_text()
    assert sum(len(text.get_text()) for text in axes.texts) == len(named)


def test_an_episode_shows_where_it_ends_and_where_the_designer_put_it(room):
    axes = Figure().subplots()
    path = np.array([(0.7, 0.5), (3.0, 0.5), (3.0, 1.0)])
    draw_episode(axes, room, path)
    (way,) = [line for line in axes.lines if len(line.get_xdata()) == 3]
    assert np.array_equal(way.get_xydata(), path)
    dashed = [patch for patch in axes.patches if not patch.get_fill()]
    (designers,) = dashed
    assert np.allclose(designers.get_extents().get_points().mean(0), axes.transData.transform(BED.center), atol=1e-6)


def test_the_grid_of_positions_is_legal_where_the_simulator_says_so(room):
    simulator = Simulator([room], Moves(), Reward())
    grid, legal = positions(simulator, 0, 0.1)
    assert legal.shape == grid.shape[:2]
    assert legal.sum() > 0
    for place, fits in zip(grid.reshape(-1, 2), legal.ravel(), strict=True):
        assert fits == simulator.legal[0].intersects(Point(place))


def test_every_kind_of_furniture_stands_in_the_legend(room):
    axes = Figure().subplots()
    room_legend(axes, [room])
    names = [text.get_text() for text in axes.get_legend().get_texts()]
    assert {"bed", "desk", "wall"} <= set(names)


def test_a_figure_is_saved_the_same_every_time(room, tmp_path: Path):
    with style.context(STYLE):
        written = []
        for name in ("one", "two"):
            figure = Figure(figsize=(2, 2))
            draw_room(axes := figure.subplots(), room)
            scale_bar(axes)
            written.append(save(figure, tmp_path / "new" / name))
    assert [file.suffix for file in written[0]] == [".png", ".svg"]
    assert all(one.read_bytes() == two.read_bytes() for one, two in zip(*written, strict=True))
    with pytest.raises(InputError, match="out: cannot write"):
        save(figure, Path("/dev/null/here"))
    (tmp_path / "taken.svg").mkdir()
    with pytest.raises(InputError, match=r"^--runs: cannot write .*taken\.svg \(Is a directory\)"):
        save(figure, tmp_path / "taken", option="--runs")
