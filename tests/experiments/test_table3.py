"""Table 3: what furnishes whole rooms, what is kept of it, and what is printed."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
import table3
from cell_config import folder_of
from cells import fill
from kept import RESULTS
from make_weights import PACKAGED
from packing import FLAG, unpacked, unpacked_iou
from printing import Row
from room_columns import FURNISHES

from layoutrl import InputError
from layoutrl.evaluation.statistics import paired_p_value
from layoutrl.rooms.documents import room_from_dict
from layoutrl.runs.pretrained import cards
from tests.experiments.builders import REAL, cell, configured, script

pytestmark = pytest.mark.usefixtures("content_furnisher")
TINY = ("table=table3", "room=bedroom", "planit.updates={smoke: 2}")


@pytest.mark.usefixtures("small_planit")
@pytest.mark.parametrize("column", [*FURNISHES, "annealer_long", "search_long"])
def test_every_column_furnishes_the_held_out_rooms(column, tmp_path, designed):
    few = ("share_of_rooms=0.34",) if column != "designer" else ()
    config = configured(tmp_path, *TINY, f"column={column}", designed, *few)
    fill(config)
    kept = cell(config)
    (row,) = kept["rows"].values()
    count = 6 if column == "designer" else 2
    assert kept["rooms"] == len(unpacked_iou(row["iou"])) == len(unpacked(row["faultless_rooms"], FLAG)) == count
    assert row["seconds"] >= 0
    assert len([room_from_dict(layout) for layout in kept["layouts"]]) == 2
    if column == "designer":
        assert row["mean_iou"] == row["facing"] == row["faultless"] == row["reached"] == 1
        assert row["overlap"] == row["outside"] == row["blocked"] == row["missing"] == 0
    else:
        assert row["mean_iou"] < 1


def test_the_table_compares_with_the_best_rival_in_the_rooms_of_both(tmp_path, designed):
    for room in ("bedroom", "tatami"):
        for column in ("designer", "nearest", "random"):
            few = ("share_of_rooms=0.5",) if column == "random" else ()
            fill(configured(tmp_path, *TINY, f"column={column}", f"room={room}", designed, *few))
    done = script("table3.py", "column=designer", "room=tatami", *TINY[2:], designed, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "results" / "smoke"
    with (folder / "table3-best.csv").open() as file:
        rows = {(row["room"], row["method"]): row for row in csv.DictReader(file)}
    methods = ("designer", "nearest room", "random")
    assert [*rows] == [(room, method) for room in ("bedroom", "tatami") for method in methods]
    for room in ("bedroom", "tatami"):
        assert float(rows[room, "designer"]["mean_iou"]) == float(rows[room, "designer"]["faultless"]) == 1
        assert rows[room, "designer"]["p_iou"] == ""
        assert rows[room, "nearest room"]["p_iou"] == rows[room, "random"]["p_iou"] != ""  # each other's best rival
        assert (rows[room, "nearest room"]["n"], rows[room, "random"]["n"]) == ("6", "3")
    assert "| tatami | nearest room |" in done.stdout
    assert "| bedroom" not in done.stdout  # what was asked for
    assert "Table 3: what is wrong with them?" in (folder / "table3.md").read_text()


def test_rivals_of_other_rooms_are_not_compared(tmp_path, designed):
    fill(config := configured(tmp_path, *TINY, "column=random", designed))
    fill(configured(tmp_path, *TINY, "column=search", designed, "data.train_rooms=5"))  # which it does not see
    assert table3.tables(folder_of(config))
    fill(configured(tmp_path, *TINY, "column=nearest", designed, "data.seed=1"))
    with pytest.raises(InputError, match=r"cells of different data\.seed cannot be compared"):
        table3.tables(folder_of(config))


@pytest.mark.skipif(not REAL.is_dir(), reason=f"the real rooms are not in {REAL}")
def test_real_rooms_are_a_table_of_their_own(tmp_path):
    real = ("data=designer_rooms", f"data.root={REAL / 'designer_rooms'}")
    config = configured(tmp_path, *TINY, "column=nearest", "room=tatami", *real)
    fill(config)
    fill(configured(tmp_path, *TINY, "column=rooms_pointer", "room=tatami", *real, "trained_on=designer"))
    fill(configured(tmp_path, *TINY, "column=rooms_package", "room=tatami", *real))
    *_, best, _, _ = table3.tables(folder_of(config))
    words = ("agent", "pointer in sequence, trained on designed rooms", "nearest room")
    assert [line[:2] for line in best.lines] == [["tatami", method] for method in words]
    assert cell(config)["rooms"] > 2


def test_sweeps_have_all_types_and_methods_and_real_rooms_of_two():
    columns = {column for sweep in table3.SWEEPS for column in sweep.split(",")}
    assert columns == {*table3.METHODS.values(), *table3.LEARNS.values()}
    assert {stage["column"] for stage in table3.stages({})} == {*table3.SWEEPS} - {"rooms_agent"}
    sweeps = table3.stages({"designer_rooms": "x", "room": "kitchen,tatami", "column": "search", "floorplans": "y"})
    assert [sweep["room"] for sweep in sweeps] == ["kitchen,tatami", "tatami"]
    assert all("floorplans" not in sweep for sweep in sweeps)
    learned = table3.stages({"designer_rooms": "x", "room": "tatami", "column": "rooms_agent"})
    assert [sweep["trained_on"] for sweep in learned] == ["designer,own,both"]
    both = table3.stages({"designer_rooms": "x", "room": "bedroom,tatami", "column": "rooms_agent,rooms_pointer"})
    learn = [sweep for sweep in both if "data" in sweep]
    told = [(sweep["column"], sweep["room"], sweep.get("method.updates.default")) for sweep in learn]
    assert told == [
        ("rooms_agent", "bedroom", "30000"), ("rooms_pointer", "bedroom", None),
        ("rooms_agent", "tatami", "24000"), ("rooms_pointer", "tatami", None),
    ]  # fmt: skip
    options = {option for sweep in learn for option in sweep if option.startswith("method.")}
    assert options == {"method.updates.default"}  # else they learn as in designed rooms
    for room in ({}, {"designer_rooms": "x", "room": "kitchen"}):
        with pytest.raises(InputError, match="column: rooms_agent learns in real rooms; expected designer_rooms="):
            table3.stages({"column": "nearest,rooms_agent"} | room)
    assert "trained_on" not in sweeps[1]
    mixed = table3.stages(
        {"designer_rooms": "x", "room": "tatami", "column": "nearest,rooms_package,rooms_agent", "trained_on": "both"}
    )
    told = [(sweep["column"], sweep.get("trained_on")) for sweep in mixed]
    assert told == [("nearest,rooms_package", None), ("rooms_agent", "both"), ("nearest,rooms_package", None)]
    with pytest.raises(InputError, match=r"column: expected some of .*; got geometric"):
        table3.stages({"column": "designer,geometric"})
    with pytest.raises(InputError, match="room: expected some of"):
        table3.stages({"room": "attic"})


def test_real_rooms_are_furnished_by_what_their_table_shows_and_by_what_is_asked_for():
    def furnish(**chosen: str) -> set[str]:
        sweeps = table3.stages({"designer_rooms": "x", "room": "tatami"} | chosen)
        return {column for sweep in sweeps if "data" in sweep for column in sweep["column"].split(",")}

    quick = {"designer", "random", "nearest", "rooms_package", "annealer", "search"}
    assert furnish() == quick | {*table3.LEARNS.values()}
    assert furnish(column="search_long,rooms_agent") == {"search_long", "rooms_agent"}


def test_the_best_rival_is_that_of_the_rooms_that_all_furnished():
    rng = np.random.default_rng(0)
    own = np.full(20, 0.5)
    worse = np.concatenate([np.full(20, 0.4), np.full(80, 1.0)])  # better, but in other rooms
    better = np.full(40, 0.6) + rng.normal(0, 0.01, 40)
    row = Row(own[None], np.arange(20), [], {})
    expected = paired_p_value(own, better[:20], np.arange(20), seed=0)
    assert table3.p_value(own, [worse, better], row) == expected < 0.001
    assert table3.p_value(own, [own], row) == 1


def test_a_rival_that_is_not_the_best_leaves_no_room_out():
    rng = np.random.default_rng(0)
    own = rng.uniform(size=200)
    best, slow = own + 0.05 + rng.normal(0, 0.1, 200), own[:10] - 0.5
    row = Row(own[None], np.arange(200), [], {})
    expected = paired_p_value(own, best, np.arange(200), seed=0)
    assert table3.p_value(own, [best, slow], row) == expected
    assert expected < 0.001


def test_the_designers_own_layouts_are_the_test_of_the_measures():
    """In 1,000 unseen rooms of each type, as far as the cells are kept."""
    kept = sorted((RESULTS / "default" / "table3").glob("*-own-designer-seed0.json"))
    designed = [file for file in kept if "designer_rooms" not in file.name]
    assert len(designed) in (0, 8)
    for file in designed:
        found = json.loads(file.read_text())
        assert found["rooms"] == 1000
        assert found["rows"]["layouts"]["faultless"] == found["rows"]["layouts"]["facing"] == 1


def test_the_table_tells_of_the_agents_that_are_in_the_package():
    for room_type, card in cards().items():
        kept = json.loads((RESULTS / f"default/table3/{room_type}-own-{PACKAGED}-seed0.json").read_text())
        (row,) = kept["rows"].values()
        row |= {"iou": row["mean_iou"]}
        assert {name: row[name] for name in card["measures"]} == card["measures"], room_type
