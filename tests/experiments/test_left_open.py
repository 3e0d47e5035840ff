"""How much of a layout a brief leaves open."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import left_open
import numpy as np
import pytest

from layoutrl.rooms.designer.generator import design_room
from layoutrl.rooms.designer.places import ends, middles
from layoutrl.rooms.designer.search import Piece, Step


def test_guessing_dice_fall_on_sizes_of_the_brief_and_know_how_likely_that_was() -> None:
    fell: Counter[int] = Counter()
    for seed in range(400):
        dice = left_open.Guessing({120}, seed)
        width, with_lamp = dice.between(100, 140, 10), dice.chance(25)
        assert dice.drawn == [width, with_lamp]
        assert dice.likelihood == pytest.approx(1 / 5 * (0.25 if with_lamp else 0.75))
        fell[width] += 1
    assert set(fell) == {100, 110, 120, 130, 140}  # a piece that was left out had another size
    assert fell[120] > 300


def test_dice_that_know_no_size_are_fair() -> None:
    fell = Counter(left_open.Guessing(set(), seed).pick({60: 1, 70: 3}) for seed in range(400))
    assert fell[70] / 400 == pytest.approx(0.75, abs=0.08)


def test_pieces_may_become_a_list_that_lacks_optional_ones_alone() -> None:
    room = design_room("tatami", "test", 0, 0).room
    steps = [
        Step(Piece(item.category, round(100 * item.size[1]), round(100 * item.size[0])), ends)
        for item in room.furniture
    ]
    more = Piece("stool", 40, 40)
    assert left_open.may_become(steps, room)
    assert left_open.may_become([*steps, Step(more, middles, optional=True)], room)
    assert not left_open.may_become([*steps, Step(more, middles)], room)
    assert not left_open.may_become(steps[1:], room)


@pytest.mark.parametrize("room_type", ["study", "balcony", "kitchen"])  # of which counters are cut to fit
def test_the_designers_own_layout_is_among_those_that_a_brief_leaves_open(room_type: str) -> None:
    designed = design_room(room_type, "test", 0, 3)
    found = left_open.left_open(designed.room, designed.shell)
    assert found is not None
    assert designed.room.furniture in found.layouts
    assert found.share.sum() == pytest.approx(1)
    np.testing.assert_allclose(found.iou.diagonal(), 1)


def test_layouts_count_as_often_as_they_would_be_drawn() -> None:
    iou = np.array([[1.0, 0.1, 0.1], [0.1, 1.0, 0.9], [0.1, 0.9, 1.0]])
    for share, safest in (([0.6, 0.2, 0.2], 0), ([0.3, 0.4, 0.3], 1)):
        assert left_open.LeftOpen([(), (), ()], np.array(["a", "b", "b"]), np.array(share), iou).safest == safest
    designed = design_room("study", "test", 0, 28)  # two templates make its list
    found = left_open.left_open(designed.room, designed.shell)
    assert found is not None
    assert found.template.tolist() == ["command", "at_wall"]
    numbers = left_open.numbers_of(designed, found)
    assert numbers["several templates make it"] == 1
    assert numbers["IoU of two templates"] < 0.5
    # Width and depth of the desk, and width of the bookcase: one of 3 widths, 60%, one of 5; one of 5, 30%, one of 6.
    assert found.share.tolist() == pytest.approx([0.8, 0.2])


def test_a_mirrored_shell_is_a_shell_with_left_and_right_changed() -> None:
    for index in range(20):
        shell = design_room("study", "test", 0, index).shell
        image = left_open.mirrored(shell)
        assert left_open.mirrored(image) == shell
        assert (image.area, len(image.walls)) == (shell.area, len(shell.walls))
        assert all(image.holds(swing) for swing in image.swings)


@pytest.mark.parametrize(("room_type", "index", "alike"), [("study", 14, False), ("balcony", 0, True)])
def test_a_mirrored_study_is_furnished_otherwise(
    room_type: str, index: int, alike: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(left_open, "TRIES", 600)
    designed = design_room(room_type, "test", 0, index)
    found = left_open.left_open(designed.room, designed.shell)
    assert found is not None
    assert (left_open.numbers_of(designed, found)["mirrored"] > 0.9) == alike


def test_it_is_told_and_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(left_open, "TRIES", 600)
    monkeypatch.setattr("sys.argv", ["left_open.py", "balcony", "--rooms=3", f"--results={tmp_path / 'new'}"])
    left_open.main()
    result = json.loads((tmp_path / "new" / "balcony.json").read_text())
    assert result["rooms"] == result["layouts"]["rooms"] == 3
    assert result["the safest, IoU"]["mean"] > 0.9
    assert result["the designer's own is found"]["mean"] == 1
    assert "balcony, the safest" in capsys.readouterr().out
