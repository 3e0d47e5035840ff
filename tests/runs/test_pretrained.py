"""The agents in the package: they are what weights.json and docs/agents.md say, and furnish rooms of their type."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import make_weights
import numpy as np
import pytest
import torch

from layoutrl import InputError
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.clearances import angle_off
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.faults import MISSING, faults
from layoutrl.rooms.room import Item
from layoutrl.runs import pretrained
from tests.builders import opening, rectangular_room
from tests.commands import PROJECT

CPU = torch.device("cpu")
TYPES = [*pretrained.cards()]


@pytest.mark.parametrize("room_type", TYPES)
def test_every_agent_is_what_is_said_of_it_and_places_all_items_the_same_again(room_type: str) -> None:
    furnisher = pretrained.load(room_type, CPU)  # which compares the hash
    briefs = [brief_of(room) for room in design_rooms(room_type, "test", 5, 1).rooms]
    layouts, again = ([one.layout for one, *_ in furnisher.furnish(briefs, 1, seed)] for seed in (3, 4))
    assert layouts == again
    assert not any(fault == MISSING for layout in layouts for _, fault in faults(layout))
    assert {item.category for brief in briefs for item in brief.furniture} <= {*pretrained.known(room_type)}
    card = pretrained.cards()[room_type]
    assert {"licence", "command", "seed", "data", "updates", "commit", "layoutrl", "measures"} <= card.keys()


def test_a_loveseat_that_is_alone_looks_at_the_television_as_a_sofa_does() -> None:
    sizes = {"loveseat": (0.85, 1.5), "coffee_table": (0.6, 1.1), "tv_unit": (0.4, 1.6)}
    items = tuple(Item(category, size, None, None) for category, size in sizes.items())
    as_living_room = {"others": items[1:], "room_type": "living_room", "target": None}
    briefs = []
    for width, depth in ((3.4, 3.8), (4.5, 3.6)):
        openings = opening("door", 0.3, -0.15, 1.2, 0.0), opening("window", 1.0, depth, 2.6, depth + 0.15)
        briefs.append(rectangular_room(width, depth, items[0], openings=openings, **as_living_room))
    for brief, (found, *_) in zip(briefs, pretrained.Agents(CPU).furnish(briefs, 1, 0), strict=True):
        seat, _, television = found.layout.furniture
        assert [item.kind for item in found.layout.furniture] == [item.kind for item in brief.furniture]
        x, y = np.subtract(television.center, seat.center)
        assert angle_off(np.degrees(np.arctan2(y, x)) - seat.degrees, 360) < 20


def test_what_is_a_sofa_already_stays_one() -> None:
    for room_type in TYPES:
        for room in design_rooms(room_type, "test", 1, 5).rooms:
            assert pretrained.with_a_sofa(brief_of(room)) == brief_of(room)
    two = (Item("loveseat", (0.85, 1.5)), Item("armchair", (0.8, 0.8)), Item("loveseat", (0.85, 1.6)))
    brief = rectangular_room(4, 4, two[0], others=two[1:], room_type="living_room", target=None)
    assert [item.category for item in pretrained.with_a_sofa(brief).furniture] == ["loveseat", "armchair", "sofa"]
    assert pretrained.with_a_sofa(replace(brief, room_type="study")).furniture == two


def test_all_files_are_named_and_small() -> None:
    there = {path.name: path.stat().st_size for path in (PROJECT / "layoutrl/weights").iterdir()}
    assert {*there} == {pretrained.ABOUT} | {card["file"] for card in pretrained.cards().values()}
    assert sum(there.values()) < 5_000_000
    assert all(there[card["file"]] == card["bytes"] for card in pretrained.cards().values())


def test_a_damaged_file_and_a_type_without_an_agent_are_answered_in_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(
        InputError, match=rf"^room_type: no agent furnishes a cellar; expected one of {TYPES[0]}[\w, ]*$"
    ):
        pretrained.load("cellar", CPU)
    shutil.copytree(PROJECT / "layoutrl/weights", tmp_path / "weights")
    monkeypatch.setattr(pretrained, "FOLDER", tmp_path / "weights")
    file = tmp_path / "weights" / pretrained.cards()[TYPES[0]]["file"]
    content = bytearray(file.read_bytes())
    content[1000] ^= 1
    file.write_bytes(content)
    with pytest.raises(InputError, match=r"^weights: .* is damaged or missing; expected it as installed: .*$"):
        pretrained.load(TYPES[0], CPU)
    file.unlink()
    with pytest.raises(InputError, match=r"^weights: .* is damaged or missing"):
        pretrained.load(TYPES[0], CPU)


def test_the_page_is_what_weights_json_implies() -> None:
    about = json.loads((make_weights.WEIGHTS / pretrained.ABOUT).read_text(encoding="utf-8"))
    assert make_weights.PAGE.read_text(encoding="utf-8") == make_weights.page_of(about)


def test_the_types_whose_agents_place_a_category_are_those_that_know_it() -> None:
    assert pretrained.types_with("bed")
    assert pretrained.types_with("totem") == []
    assert all("chair" in pretrained.known(room_type) for room_type in pretrained.types_with("chair"))
