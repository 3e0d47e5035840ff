"""The worst rooms of a cell, and why they failed."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import worst_rooms
from cell_config import name_of
from cells import fill

from layoutrl.rooms.room import Item
from layoutrl.rooms.sources.parts import Data
from tests.builders import rectangular_room
from tests.experiments.builders import configured


def test_the_worst_rooms_are_drawn_and_explained(tmp_path, designed, monkeypatch, capsys):
    config = configured(tmp_path, designed, "column=geometric", "room=tatami")
    fill(config)
    file = tmp_path / "results" / "smoke" / "table1" / f"{name_of(config)}.json"
    cell = json.loads(file.read_text())
    del cell["config"]["planit"]  # as in cells of before there was one
    file.write_text(json.dumps(cell))
    root = f"--root={config.data.root}"
    arguments = ["worst_rooms.py", name_of(config), "--budget=smoke", root, f"--results={tmp_path / 'results'}"]
    monkeypatch.setattr("sys.argv", arguments)
    capsys.readouterr()
    worst_rooms.main()
    assert (tmp_path / "results" / "smoke" / "worst" / f"{name_of(config)}.png").stat().st_size > 10_000
    counts = dict(re.findall(r"  ([a-z ]+?) +(\d+) rooms", capsys.readouterr().out))
    assert sum(map(int, counts.values())) == 6
    monkeypatch.setattr("sys.argv", [*arguments, "--table=table9"])
    with pytest.raises(SystemExit, match="no such cell"):
        worst_rooms.main()


def test_why_a_room_failed(tmp_path):
    room = rectangular_room(4, 3, Item("bed", (1.0, 0.6), (2.0, 1.5)))
    config = replace(configured(tmp_path, "column=geometric"), data=Data("designer_rooms"))
    assert worst_rooms.why(room, np.array([2.2, 1.5]), True, config) == "imprecise"
    assert worst_rooms.why(room, np.array([2.2, 1.7]), True, config) == "knew better"
    assert worst_rooms.why(room, np.array([2.2, 1.7]), False, config) == "wrong place"


def test_rooms_are_told_apart_by_what_the_plan_calls_them():
    room = rectangular_room(4, 3, Item("bed", (1.0, 0.6), (2.0, 1.5)))
    assert worst_rooms.kind_of(replace(room, id="00/02/0001#washing_room-2")) == "washing_room"
    assert worst_rooms.kind_of(replace(room, id="b-17")) == ""


def test_the_worst_rooms_stand_in_the_same_order_on_every_machine():
    room = rectangular_room(4, 3, Item("bed", (1.0, 0.6), (2.0, 1.5)))
    rooms = [replace(room, id=name) for name in "dcbea"]
    iou = np.array([0.0, 1e-9, 0.5, 0.0, 0.2])  # a last digit may differ between machines
    assert [rooms[k].id for k in worst_rooms.worst(rooms, iou)] == ["c", "d", "e", "a", "b"]
    assert len(worst_rooms.worst(rooms * 3, np.tile(iou, 3))) == 10
