"""Rooms disturbed as flats are, and what stands at their walls."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import irregular_rooms
import pytest
from irregular_rooms import at_the_wall

from layoutrl.rooms.brief import Pose, missing, with_poses
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.furnished import Furnished
from layoutrl.rooms.room import Item, Room
from tests.builders import rectangular_room


def test_what_belongs_to_the_wall_and_stands_off_it_is_counted() -> None:
    def room(*gaps: float):
        beds = tuple(Item("bed", (2.0, 0.5), (1.0 + gap, 0.5 + 0.6 * k), 0.0) for k, gap in enumerate(gaps))
        return replace(rectangular_room(6, 4, beds[0], others=beds[1:]), target=None)

    design = room(0, 0, 0, 0)
    assert at_the_wall([design], [design]) == 1
    assert at_the_wall([room(0, 0.01, 0.05, 1.0)], [design]) == 0.5
    turned = replace(design, furniture=tuple(replace(item, rotation=180.0) for item in design.furniture))
    assert at_the_wall([turned], [design]) == 0  # their feet are at the wall


class Remembers:
    """Furnishes as the designer did, or so that all stands in one corner."""

    def __init__(self, designs: Sequence[Room], well: bool):
        self.designs, self.well = {design.id: design for design in designs}, well

    def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
        assert choices == 1
        layouts = []
        for brief in briefs:
            assert len(missing(brief)) == len(brief.furniture)
            places = {k: self._pose(brief, k) for k in missing(brief)}
            layouts.append([Furnished(with_poses(brief, places), 0.0)])
        return layouts

    def _pose(self, brief: Room, k: int) -> Pose:
        item = brief.furniture[k]
        if not self.well:
            return (1.0, 1.0), 0.0
        those = sorted(self.designs[brief.id].furniture, key=lambda i: (i.category, i.size, i.form, i.tucked))
        assert those[k].category == item.category
        return those[k].center, those[k].degrees


@pytest.mark.parametrize("well", [True, False])
def test_a_type_is_measured(well: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    designs = design_rooms("balcony", "test", 1, 4).rooms
    monkeypatch.setattr(irregular_rooms, "load", lambda *_: Remembers(designs, well))
    monkeypatch.setattr("sys.argv", ["irregular_rooms.py", "balcony", "--rooms=2", f"--results={tmp_path}"])
    irregular_rooms.main()
    result = json.loads((tmp_path / "balcony.json").read_text())
    assert result["rooms"] == 2
    assert sum(result["disturbances"].values()) >= 2
    for name in ("as designed", "disturbed"):
        told = result[name]
        assert (told["iou"]["mean"] == pytest.approx(1), told["at_the_wall"] == 1) == (well, well)
        assert told["faultless"]["mean"] == well


def test_where_fewer_rooms_can_be_disturbed_that_is_said_before_any_is_furnished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        irregular_rooms, "disturbed", lambda rooms, _: [(rooms[0], ["column"]), *((r, []) for r in rooms[1:])]
    )
    monkeypatch.setattr(irregular_rooms, "load", None)
    monkeypatch.setattr("sys.argv", ["irregular_rooms.py", "balcony", "--rooms=2", f"--results={tmp_path}"])
    with pytest.raises(
        SystemExit, match=r"^error: --rooms: expected fewer, as 1 of 4 rooms could be disturbed; got 2$"
    ):
        irregular_rooms.main()
    assert not list(tmp_path.iterdir())
