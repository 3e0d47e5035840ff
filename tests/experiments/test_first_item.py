"""How much depends on the place of the first item."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import first_item
import pytest

from layoutrl.rooms.brief import brief_of, largest_first, missing, with_poses
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.furnished import Furnished
from layoutrl.rooms.room import Item, Room
from tests.builders import rectangular_room


def test_the_first_item_is_held_against_the_nearest_of_its_equals_and_the_others_without_it() -> None:
    bed, twin = Item("bed", (2.0, 0.9), (1.0, 0.45), 0.0), Item("bed", (2.0, 0.9), (1.0, 2.5), 0.0)
    desk = Item("desk", (0.6, 1.2), (3.7, 1.5), 180.0)
    design = replace(rectangular_room(4, 3, bed, others=(twin, desk)), target=None)
    swapped = replace(design, furniture=(twin, bed, replace(desk, center=None)))
    assert first_item.compared(swapped, 0, design) == pytest.approx((1, 0.5))  # the other bed, and no desk
    nowhere = replace(design, furniture=(replace(bed, center=None), twin, desk))
    assert first_item.compared(nowhere, 0, design) == pytest.approx((0, 1))


def test_a_type_is_measured_and_the_first_item_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    designs = {room.id: room for room in design_rooms("balcony", "test", 0, 4).rooms}

    class PutsTheFirstWrong:
        """Puts all of every other room outside, unless the largest item is given; and all else right."""

        def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
            assert choices == 1
            layouts = []
            for n, brief in enumerate(briefs):
                design = brief_of(designs[brief.id])
                right = sorted(designs[brief.id].furniture, key=lambda i: (i.category, i.size, i.form, i.tucked))
                first = largest_first(design)[0]
                poses = {k: (right[k].center, right[k].degrees) for k in missing(brief)}
                if n % 2 and first in poses:
                    poses = dict.fromkeys(poses, ((-9.0, -9.0), 0.0))
                layouts.append([Furnished(with_poses(brief, poses), 0.0)])
            return layouts

    monkeypatch.setattr(first_item, "load", lambda *_: PutsTheFirstWrong())
    monkeypatch.setattr("sys.argv", ["first_item.py", "balcony", "--rooms=4", f"--results={tmp_path / 'new'}"])
    first_item.main()
    result = json.loads((tmp_path / "new" / "balcony.json").read_text())
    assert result["it is right"]["mean"] == 0.5
    for name, iou in (("right", 1), ("wrong", 0), ("given", 1)):
        assert result[f"the others, where it is {name}"]["mean"] == pytest.approx(iou)
