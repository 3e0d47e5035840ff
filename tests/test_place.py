"""Rooms of a user's own: what is placed, what is said, and that nothing is lost."""

from __future__ import annotations

import errno
import json
import os
import re
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from io import BytesIO, StringIO, TextIOWrapper
from itertools import combinations
from pathlib import Path
from queue import Queue
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import layoutrl.figures.drawing
import layoutrl.place
import layoutrl.rooms.sources.sweethome3d
import layoutrl.runs.file_placer
from layoutrl import InputError
from layoutrl.evaluation.furnishing import Furnisher
from layoutrl.evaluation.moving import STARTS_PER_FACING
from layoutrl.evaluation.policy import GreedyPolicy, greedy
from layoutrl.evaluation.rollout import Rollout
from layoutrl.place import furnish
from layoutrl.place import run as place
from layoutrl.rivals.budgets import updates_budget
from layoutrl.rivals.rooms import rival
from layoutrl.rivals.rooms.annealer import MOVES
from layoutrl.rooms.brief import missing, with_poses
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.documents import room_from_dict, room_to_dict, with_layout
from layoutrl.rooms.formats import opened, to_place
from layoutrl.rooms.furnished import Furnished, same
from layoutrl.rooms.room import Item, Room
from layoutrl.runs import pretrained, streams
from layoutrl.runs.config import PlaceConfig, TrainConfig, composed, narrowed
from layoutrl.runs.furnishers import FurnisherInfo, Helped, furnisher_for
from layoutrl.train import run as train
from tests.builders import rectangular_room
from tests.commands import layoutrl as command
from tests.rooms.sources.test_sweethome3d import BED, FLAT, home_file, piece, room_tag
from tests.runs.test_resume import SHORT

DOCUMENTS = [room_to_dict(room) for room in design_rooms("bedroom", "test", 3, 3).rooms]


@pytest.fixture(scope="module")
def agent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """That moves every item."""
    folder = tmp_path_factory.mktemp("agent")
    rooms = written(folder, [room_to_dict(room) for room in design_rooms("bedroom", "train", 0, 8).rooms])
    given = ("room=bedroom", "room.item=all", "data=json", f"data.root={rooms}", f"runs={folder}")
    few = ("method.updates.smoke=2", "budget.evaluations=1", "budget.reports=1")
    return train(narrowed(composed("train", *given, *SHORT, *few), TrainConfig))


def written(folder: Path, documents: list[dict[str, Any]]) -> Path:
    file = folder / "rooms.jsonl"
    file.write_text("\n".join(map(json.dumps, documents)))
    return file


def without_place(document: dict[str, Any], **changed: Any) -> dict[str, Any]:
    """The document, its target without a center and changed."""
    found = json.loads(json.dumps(document))
    item = found["furniture"][found["target"]]
    del item["center"]
    item |= changed
    return found


def run(config: PlaceConfig) -> list[dict[str, Any]]:
    """The rooms as they are written."""
    (file,) = place(config).files
    return [json.loads(line) for line in file.read_text().splitlines()]


def bare(document: dict[str, Any]) -> dict[str, Any]:
    """The document without any center or rotation."""
    found = json.loads(json.dumps(document))
    for item in found["furniture"]:
        del item["center"], item["rotation"]
    return found


def test_an_item_that_the_agent_does_not_know_is_not_placed_and_other_furniture_is_no_matter(
    agent: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    strange, known, beside = (without_place(document) for document in DOCUMENTS)
    strange["furniture"][strange["target"]]["category"] = "waterbed"
    other = next(k for k in range(len(beside["furniture"])) if k != beside["target"])
    beside["furniture"][other]["category"] = "totem"
    file = written(tmp_path, [strange, known, beside])
    rooms = run(PlaceConfig(run=str(agent), rooms=str(file), device="cpu"))
    assert [room["id"] for room in rooms] == [document["id"] for document in DOCUMENTS]
    items = [room["furniture"][room["target"]] for room in rooms]
    assert ["center" in item for item in items] == [False, True, True]
    assert items[0]["faults"] == ["not placed"]
    said = capsys.readouterr().out
    unknown = "the waterbed is not placed: who is asked places no waterbed in a bedroom; expected one of "
    assert f"{rooms[0]['id']}: 0 of 1 placed; {unknown}" in said
    assert "placed 2 of 3 items in 3 rooms" in said


def test_an_agent_places_all_that_it_was_trained_to_move_in_rooms_of_its_type(
    agent: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    documents = [bare(document) for document in DOCUMENTS]
    documents[1]["room_type"] = "study"
    file = written(tmp_path, documents)
    rooms = run(PlaceConfig(run=str(agent), rooms=str(file), device="cpu"))
    assert all({"center", "rotation"} <= item.keys() for room in rooms[::2] for item in room["furniture"])
    assert not any("center" in item for item in rooms[1]["furniture"])
    assert "nobody who is asked furnishes a study" in capsys.readouterr().out
    only = run(PlaceConfig(run=str(agent), rooms=str(file), item="bed", device="cpu", out=str(tmp_path / "o.jsonl")))
    placed = {item["category"] for item in only[0]["furniture"] if "center" in item}
    assert placed == {"bed"}


def test_an_item_without_rotation_goes_and_faces_where_its_value_is_highest(
    agent: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    document = without_place(DOCUMENTS[0])
    del document["furniture"][document["target"]]["rotation"]
    given = without_place(DOCUMENTS[1], rotation=180)
    written(tmp_path, [document, given])

    monkeypatch.setattr(layoutrl.runs.file_placer, "blocks", lambda entries: [[*entries]])
    chosen: list[np.ndarray] = []

    def rotations(facing: int) -> list[float]:
        class Best(GreedyPolicy):
            def rollout(self, *args: Any) -> Rollout:
                found = super().rollout(*args)
                way, start = np.divmod(np.arange(len(found.final)), STARTS_PER_FACING)
                assert way.max() == 4  # four ways, and the one that is given
                found.promise[:] = (way == facing) + (start == 2) / 2
                chosen.append(found.final[STARTS_PER_FACING * facing + 2])
                return found

        monkeypatch.setattr(
            layoutrl.evaluation.moving, "greedy", lambda network, method: Best(**vars(greedy(network, method)))
        )
        out = tmp_path / f"{facing}.jsonl"
        rooms = run(PlaceConfig(run=str(agent), rooms=str(tmp_path / "rooms.jsonl"), out=str(out), device="cpu"))
        placed = [room["furniture"][room["target"]] for room in rooms]
        assert placed[0]["center"] == pytest.approx(chosen[-1], abs=1e-3)  # of the starts the one that is valued most
        return [item["rotation"] for item in placed]

    assert [rotations(facing) for facing in range(4)] == [[90.0 * facing, 180.0] for facing in range(4)]


@pytest.mark.parametrize("by", ["search", "annealer"])
def test_without_an_agent_all_that_has_no_center_is_placed_and_what_cannot_be_is_named(
    by: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rival, "DESIGNED", 20)
    documents = [*map(bare, DOCUMENTS[:2]), DOCUMENTS[2]]
    documents[1]["furniture"][0] |= {"category": "waterbed"}
    documents[1]["furniture"][1]["size"] = [9, 9]
    file = written(tmp_path, documents)
    rooms = run(composed("place", f"by={by}", f"rooms={file}", "seconds=0.1"))
    assert rooms[2] == documents[2]
    assert all({"center", "rotation"} <= item.keys() for item in rooms[0]["furniture"])
    assert [k for k, item in enumerate(rooms[1]["furniture"]) if "center" not in item] == [0, 1]
    said = capsys.readouterr().out
    unknown = "the waterbed is not placed: who is asked places no waterbed in a bedroom; expected one of "
    assert f"{rooms[1]['id']}: 3 of 5 placed; {unknown}" in said
    assert f"the {documents[1]['furniture'][1]['category']} of 9 by 9 m is not placed: it fits into the room" in said


def test_search_has_more_than_one_layout_of_a_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rival, "DESIGNED", 20)
    monkeypatch.setattr(rival, "SEEDS", (0,))
    file = written(tmp_path, [bare(DOCUMENTS[1])])  # in which they differ, however long it searches
    rooms = run(composed("place", "by=search", f"rooms={file}", "seconds=1e-9", "choices=2"))
    assert len(rooms) == 2


def test_lengths_are_written_in_the_unit_in_which_they_came(middle: Middle, tmp_path: Path) -> None:
    file, documents = many(tmp_path, 1)
    (metres,) = run(PlaceConfig(by="search", rooms=str(file), out=str(tmp_path / "metres.jsonl")))
    (large,) = documents
    for name in ("outline", "walls", "doors", "windows"):
        text = json.dumps(large[name])
        large[name] = json.loads(text, parse_float=lambda number: float(number) * 100)
    for item in large["furniture"]:
        item["size"] = [100 * side for side in item["size"]]
    (room,) = run(PlaceConfig(by="search", rooms=str(written(tmp_path, [large])), out=str(tmp_path / "cm.jsonl")))
    assert room["outline"] == large["outline"]
    for item, same_item in zip(room["furniture"], metres["furniture"], strict=True):
        assert item["center"] == pytest.approx([100 * side for side in same_item["center"]], abs=1e-3)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("search.grid=0", "search.grid: expected more than 0; got 0.0"),
        ("search.grid=nan", "search.grid: expected more than 0; got nan"),
        ("search.best=0", "search.best: expected 1 or more; got 0"),
        ("search.nodes=0", "search.nodes: expected 1 or more; got 0"),
        ("search.noise=-1", "search.noise: expected 0 or more; got -1.0"),
        ("+search.weights.bakc=3", "search.weights: expected one of back, side, .*; got bakc"),
        ("+search.weights.outside=3", "search.weights: expected one of back, side, .*; got outside"),
        ("~search.weights.back", "search.weights: expected back, side, .*; got no back"),
        ("search.weights.back=-3", "search.weights.back: expected 0 or more; got -3.0"),
        ("annealer.chains=0", "annealer.chains: expected 1 or more; got 0"),
        ("annealer.cold=1", "annealer.cold: expected 0 <= cold < 1; got 1.0"),
        ("annealer.last_temperature=0", "annealer.last_temperature: expected more than 0; got 0.0"),
        ("annealer.first_shift=-1", "annealer.first_shift: expected more than 0; got -1.0"),
        ("annealer.first_rules=0", "annealer.first_rules: expected more than 0; got 0.0"),
        ("+annealer.moves.jump=1", "annealer.moves: expected one of shift, turn, .*; got jump"),
        ("annealer.moves.turn=-1", "annealer.moves.turn: expected 0 or more; got -1.0"),
        ("~annealer.weights.unreached", "annealer.weights: expected outside, .*; got no unreached"),
        ("+annealer.weights.bakc=3", "annealer.weights: expected one of outside, .*; got bakc"),
    ],
)
def test_settings_of_rivals_that_are_out_of_range_are_refused_in_a_line(given: str, said: str) -> None:
    with pytest.raises(InputError, match=rf"^{said}$"):
        composed("place", "by=search", "rooms=rooms.jsonl", given)


def test_moves_that_are_never_made_are_refused() -> None:
    never = [f"annealer.moves.{kind}=0" for kind in MOVES]
    composed("place", "by=annealer", "rooms=rooms.jsonl", *never[1:])
    with pytest.raises(InputError, match=r"^annealer\.moves: expected one kind or more that is more often than 0; got"):
        composed("place", "by=annealer", "rooms=rooms.jsonl", *never)


def test_either_an_agent_places_items_or_a_rival(tmp_path: Path) -> None:
    file = written(tmp_path, DOCUMENTS)
    with pytest.raises(InputError, match=r"^run: expected either run=<folder> of a training, or by=agents, by=search"):
        place(composed("place", "by=search", "run=runs/bedroom/some", f"rooms={file}"))
    nowhere = tmp_path / "nowhere"
    with pytest.raises(InputError, match=r"^run: .*nowhere.* cannot be read .*; expected the folder of a training run"):
        place(composed("place", f"run={nowhere}", f"rooms={file}", f"pictures={tmp_path / 'pictures'}"))
    assert not (tmp_path / "pictures").exists()
    with pytest.raises(InputError, match="has no room with an item to place; expected furniture without a center"):
        place(composed("place", "by=search", f"rooms={file}"))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"seconds": 2.0}, "seconds: they are of by=search and by=annealer; expected either beside"),
        ({"seconds": 2.0, "by": "agents"}, "seconds: they are of by=search"),
        ({"seconds": 2.0, "run": "runs/bedroom/some"}, "seconds: they are of by=search"),
        ({"checkpoint": "best"}, "checkpoint: it is one of a training run; expected run=<folder> beside"),
        ({"checkpoint": "best", "by": "annealer"}, "checkpoint: it is one of a training run"),
        ({"device": "cuda", "by": "search"}, "device: by=search works on the CPU alone; expected no device=; got cuda"),
        ({"by": "search", "seconds": 2.0, "device": "cpu"}, "no such file"),
        ({"checkpoint": "best", "run": "runs/bedroom/some"}, "no such file"),
    ],
)
def test_what_those_who_furnish_do_not_use_is_refused(given: dict[str, Any], said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said):
        place(PlaceConfig(rooms=str(tmp_path / "rooms.jsonl"), **given))


def test_an_item_that_fits_into_the_walls_but_not_indoors_is_not_placed(agent: Path, tmp_path: Path) -> None:
    outline = np.array(DOCUMENTS[0]["outline"])
    long = float(np.ptp(outline, axis=0).max()) + 0.1  # the walls are twice as thick
    file = written(tmp_path, [without_place(DOCUMENTS[0], size=[long, 0.3])])
    (room,) = run(PlaceConfig(run=str(agent), rooms=str(file), device="cpu"))
    item = room["furniture"][room["target"]]
    assert "center" not in item
    assert item["faults"] == ["not placed"]


def test_up_to_so_many_layouts_differ_and_are_a_group(agent: Path, tmp_path: Path) -> None:
    file = written(tmp_path, [bare(DOCUMENTS[0])])
    rooms = run(PlaceConfig(run=str(agent), rooms=str(file), choices=3, device="cpu"))
    name = DOCUMENTS[0]["id"]
    assert [room["id"] for room in rooms] == [name, f"{name} choice 2", f"{name} choice 3"][: len(rooms)]
    layouts = [room_from_dict(room) for room in rooms]
    assert {room.group for room in layouts} == {name}
    assert len(layouts) > 1
    assert not any(same(one, other) for one, other in combinations(layouts, 2))


def test_without_a_name_the_agents_in_the_package_furnish_each_room_by_its_type(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rival, "DESIGNED", 20)
    monkeypatch.setattr(layoutrl.runs.furnishers, "RESTARTS", (1,))  # of the search that helps: tried elsewhere
    types = [*pretrained.cards()]
    rooms = [design_rooms(kind, "test", 4, 1).rooms[0] for kind in types]
    documents = [bare(room_to_dict(replace(room, furniture=room.furniture[:2]))) for room in rooms]
    west, south, *_ = rooms[0].indoor.bounds  # in a corner: what would overlap it is left out
    corner = [west + 0.15, south + 0.15]
    documents[0]["furniture"].append({"category": "totem", "size": [0.3, 0.3], "center": corner})  # no matter
    file = written(tmp_path, documents + DOCUMENTS[:1] + [bare(DOCUMENTS[0]) | {"id": "left"}])
    monkeypatch.setattr(
        pretrained, "known", lambda kind, known=pretrained.known: () if kind == "bedroom" else known(kind)
    )
    first, second = (
        run(composed("place", f"rooms={file}", "device=cpu", f"out={tmp_path / name}"))
        for name in ("1.jsonl", "2.jsonl")
    )
    assert first == second
    for room, kind in zip(first, types, strict=False):
        assert all(
            ("center" in item) == (kind != "bedroom") for item in room["furniture"] if item["category"] != "totem"
        )
    assert not any("center" in item for item in first[-1]["furniture"])
    (line, _) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("left: ")]
    assert "nobody who is asked furnishes a bedroom" in line


def test_an_agent_of_whole_rooms_furnishes_those_of_its_type(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for again in ("AFRESH", "ELSEWHERE"):  # untrained, it does no better
        monkeypatch.setattr(f"layoutrl.evaluation.furnishing.{again}", 0)
    documents = [room_to_dict(room) for room in design_rooms("bedroom", "train", 0, 8).rooms]
    given = ("room=bedroom", "scope=room", "data=json", f"data.root={written(tmp_path, documents)}", f"runs={tmp_path}")
    few = ("method.updates.smoke=2", "budget.evaluations=1", "budget.reports=1")
    folder = train(narrowed(composed("train", *given, *SHORT, *few), TrainConfig))
    hers = furnisher_for(composed("place", f"run={folder}", "rooms=any.jsonl", "device=cpu"))
    assert isinstance(hers.furnisher, Furnisher)
    assert "bed" in hers.known("bedroom")
    assert not hers.known("study")
    file = tmp_path / "mine.jsonl"
    file.write_text("\n".join(map(json.dumps, [bare(DOCUMENTS[0]), bare(DOCUMENTS[1]) | {"room_type": "study"}])))
    first, second = run(composed("place", f"run={folder}", f"rooms={file}", "device=cpu"))
    assert all({"center", "rotation"} <= item.keys() for item in first["furniture"])
    assert not any("center" in item for item in second["furniture"])
    assert "nobody who is asked furnishes a study" in capsys.readouterr().out


class Middle:
    """Puts everything into the middle of its room, at once."""

    def __init__(self) -> None:
        self.seen: list[list[bool]] = []  # of each brief, which items stand in it

    def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
        self.seen += [[item.center is not None for item in brief.furniture] for brief in briefs]
        return [[Furnished(self.layout(brief), 0.0)] for brief in briefs]

    def layout(self, brief: Room) -> Room:
        (center,) = brief.indoor.centroid.coords
        return with_poses(brief, dict.fromkeys(missing(brief), (center, 0.0)))


class NoWardrobe(Middle):
    """Finds no place for a wardrobe, and puts all else into the middle, or where a wardrobe stands, `beside` it."""

    def __init__(self, beside: tuple[float, float] | None = (1.2, 2.5)) -> None:
        super().__init__()
        self.beside = beside

    def layout(self, brief: Room) -> Room:
        there = any(item.category == "wardrobe" and item.center for item in brief.furniture)
        center = self.beside if there else (3.0, 2.5)
        wanted = [k for k in missing(brief) if brief.furniture[k].category != "wardrobe"]
        return with_poses(brief, dict.fromkeys(wanted, (center, 0.0))) if center else brief


@pytest.fixture
def middle(monkeypatch: pytest.MonkeyPatch) -> Middle:
    furnisher = Middle()
    info = FurnisherInfo(furnisher, lambda room_type: ["bed", "wardrobe", "desk", "chair", "nightstand"])
    monkeypatch.setattr(layoutrl.runs.furnishers, "furnisher_for", lambda config: info)
    return furnisher


def interrupted(monkeypatch: pytest.MonkeyPatch, at: int) -> list[str]:
    """Ctrl-C comes as the room of this number is furnished; the ids of all that are or were to be, as they come."""
    layout, seen = Middle.layout, list[str]()

    def until(self: Middle, brief: Room) -> Room:
        seen.append(brief.id)
        if len(seen) == at:
            raise KeyboardInterrupt
        return layout(self, brief)

    monkeypatch.setattr(Middle, "layout", until)
    return seen


def test_what_the_search_placed_where_an_agent_failed_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rival, "DESIGNED", 20)
    search = rival.SearchOrAnnealer(composed("place", "rooms=any.jsonl").search, lambda: updates_budget(2))
    helped = FurnisherInfo(Helped(Middle(), search), lambda room_type: search.relations(room_type).alone)
    monkeypatch.setattr(layoutrl.runs.furnishers, "furnisher_for", lambda config: helped)
    (room,) = run(PlaceConfig(rooms=str(written(tmp_path, [bare(DOCUMENTS[0])]))))
    count = len(room["furniture"])
    assert f"{room['id']}: {count} of {count} placed by the search; " in capsys.readouterr().out


def test_what_finds_no_room_stays_where_it_stood_and_all_that_is_wrong_there_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    class PlacesOne(Middle):
        """Finds a place for the first bed alone: over the other, which stood there."""

        def layout(self, brief: Room) -> Room:
            first, *others = brief.furniture
            return replace(brief, furniture=(replace(first, center=(1.2, 1.0), rotation=0.0), *others))

    beds = [{"category": "bed", "center": [1.0, y], "size": [2.0, 1.4], "rotation": 0} for y in (1.8, 0.8)]
    outline, door = [[0, 0], [2.4, 0], [2.4, 2.6], [0, 2.6]], [[1.6, -0.2], [2.3, -0.2], [2.3, 0], [1.6, 0]]
    document: dict[str, Any] = {"id": "a", "room_type": "bedroom", "outline": outline, "windows": []}
    document |= {"doors": [{"polygon": door}], "furniture": beds}
    monkeypatch.setattr(
        layoutrl.runs.furnishers, "furnisher_for", lambda config: FurnisherInfo(PlacesOne(), lambda room_type: ["bed"])
    )
    (room,) = run(PlaceConfig(rooms=str(written(tmp_path, [document])), move="all", pictures=str(tmp_path / "drawn")))
    first, second = room["furniture"]
    assert (first["center"], second["center"]) == ([1.2, 1.0], [1.0, 0.8])
    assert "overlaps" in first["faults"]
    assert second["faults"][:2] == ["not placed", "overlaps"]
    said = capsys.readouterr().out
    assert "1 of 2 placed; the bed (1 of 2): overlaps, " in said
    assert "the bed (2 of 2): not placed, as no room is left for it, and stays where it stood (overlaps)" in said
    (picture,) = (tmp_path / "drawn").iterdir()
    assert picture.read_text().count(">bed<") == 2


def test_where_nothing_finds_room_what_was_wrong_before_is_not_told_as_new(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    class PlacesNothing(Middle):
        def layout(self, brief: Room) -> Room:
            return brief

    bed, desk = (
        DOCUMENTS[0]["furniture"][DOCUMENTS[0]["target"]],
        {"category": "desk", "size": [0.6, 1.2], "rotation": 0},
    )
    document = DOCUMENTS[0] | {"furniture": [bed, desk | {"center": bed["center"]}], "target": 0}
    monkeypatch.setattr(
        layoutrl.runs.furnishers,
        "furnisher_for",
        lambda config: FurnisherInfo(PlacesNothing(), lambda room_type: ["desk"]),
    )
    (room,) = run(PlaceConfig(rooms=str(written(tmp_path, [document])), move="desk"))
    assert [item.get("faults") for item in room["furniture"]] == [None, ["not placed"]]
    assert room["furniture"][1]["center"] == bed["center"]
    said = capsys.readouterr().out
    assert "0 of 1 placed; the desk: not placed, as no room is left for it, and stays where it stood\n" in said


def test_no_picture_is_left_of_a_home_that_was_not_written(
    middle: Middle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home = home_file(tmp_path / "flat.sh3d")
    config = PlaceConfig(by="search", rooms=str(home), move="bed", pictures=str(tmp_path / "drawn"))
    monkeypatch.setattr(layoutrl.rooms.sources.sweethome3d.Home, "write", interrupt)
    with pytest.raises(KeyboardInterrupt):
        place(config)
    assert not list((tmp_path / "drawn").iterdir())


def interrupt(*_: Any) -> None:
    raise KeyboardInterrupt


def many(folder: Path, count: int = 7) -> tuple[Path, list[dict[str, Any]]]:
    documents = [bare(DOCUMENTS[k % 3]) | {"id": f"room {k}", "note": k} for k in range(count)]
    return written(folder, documents), documents


def test_a_room_of_a_long_name_is_drawn_and_what_is_stopped_leaves_no_picture_behind(
    middle: Middle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    documents = [bare(DOCUMENTS[0]) | {"id": "寝室é" * 60}, bare(DOCUMENTS[1]), bare(DOCUMENTS[2])]
    config = PlaceConfig(by="search", rooms=str(written(tmp_path, documents)), pictures=str(tmp_path / "drawn"))
    draw, drawn = layoutrl.figures.drawing.draw, list[Path]()

    def stopped(layout: Room, wrong: Sequence[tuple[int, str]], file: Path) -> None:
        draw(layout, wrong, file)
        drawn.append(file)
        if len(drawn) == stop_at:
            raise KeyboardInterrupt

    monkeypatch.setattr(layoutrl.figures.drawing, "draw", stopped)
    for stop_at, left in ((1, 0), (4, 1)):  # noqa: B007 - in the first block, of one room, and in the second, of two
        with pytest.raises(KeyboardInterrupt):
            place(config)
        assert len(list((tmp_path / "drawn").iterdir())) == left
    stop_at = 0
    place(config)
    names = sorted(file.name for file in (tmp_path / "drawn").iterdir())
    assert [name.partition("-")[0] for name in names] == ["1", "2", "3"]
    assert names[0].startswith("1-寝室é")


def test_faults_stand_in_the_file_which_is_read_again_and_all_else_is_as_it_was(middle: Middle, tmp_path: Path) -> None:
    file, documents = many(tmp_path)
    rooms = run(PlaceConfig(by="search", rooms=str(file)))
    for room, document in zip(rooms, documents, strict=True):
        assert "overlaps" in room["furniture"][0]["faults"]
        room_from_dict(room)
        for item in room["furniture"]:
            assert item.pop("rotation") == 0
            del item["center"]
            item.pop("faults", None)
        assert room == document


def test_what_moves_is_placed_anew(middle: Middle, tmp_path: Path) -> None:
    file = written(tmp_path, DOCUMENTS[:1])
    (room,) = run(PlaceConfig(by="search", rooms=str(file), move="bed"))
    moved = [k for k, item in enumerate(room["furniture"]) if item["category"] == "bed"]
    for k, (item, before) in enumerate(zip(room["furniture"], DOCUMENTS[0]["furniture"], strict=True)):
        assert (item["center"] != before["center"]) == (k in moved)


def test_everyday_names_are_those_of_categories_and_stay_in_the_file(middle: Middle, tmp_path: Path) -> None:
    (plain,) = run(
        PlaceConfig(by="search", rooms=str(written(tmp_path, [bare(DOCUMENTS[0])])), out=f"{tmp_path}/a.jsonl")
    )
    everyday = {"bed": "Bett", "wardrobe": "Kleiderschrank", "nightstand": "bedside cabinet"}
    named = bare(DOCUMENTS[0])
    for item in named["furniture"]:
        item["category"] = everyday.get(item["category"], item["category"])
    (room,) = run(PlaceConfig(by="search", rooms=str(written(tmp_path, [named])), out=f"{tmp_path}/b.jsonl"))
    assert [item["category"] for item in room["furniture"]] == [item["category"] for item in named["furniture"]]
    for item, before in zip(room["furniture"], plain["furniture"], strict=True):
        assert (item["center"], item["rotation"]) == (before["center"], before["rotation"])


def test_a_room_that_says_no_type_is_of_that_of_the_command(
    middle: Middle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    untold = bare(DOCUMENTS[0])
    del untold["room_type"]
    for item in untold["furniture"]:
        item["category"] = "nightstand"  # which tells no type
    documents = [untold | {"id": "x"}, untold | {"id": "Schlafzimmer"}, bare(DOCUMENTS[0]) | {"id": "told"}]
    file = written(tmp_path, documents)
    config = PlaceConfig(by="search", rooms=str(file), room_type="study")
    rooms = run(config)
    assert [room["room_type"] for room in rooms] == ["study", "bedroom", "bedroom"]
    said = capsys.readouterr().out
    assert said.count("; it is taken for a study") == 1
    assert "x: nothing tells its type; it is taken for a study" in said


def furnished_room(**changed: Any) -> dict[str, Any]:
    """A bedroom of 6 m by 5 m: a bed, a table with a chair under it and one beside, and two plants at one place."""
    items = [
        ("bed", 1.0, 1.0, (2.0, 1.5)), ("table", 4.0, 3.0, (1.2, 0.8)), ("chair", 4.0, 2.5, (0.4, 0.4)),
        ("chair", 5.0, 1.0, (0.4, 0.4)), ("plant", 0.5, 4.5, (0.4, 0.4)), ("plant", 0.5, 4.4, (0.4, 0.4)),
    ]  # fmt: skip
    return {
        "id": "flat",
        "room_type": "bedroom",
        "outline": [[0, 0], [6, 0], [6, 5], [0, 5]],
        "windows": [],
        "doors": [{"polygon": [[5, -0.2], [5.8, -0.2], [5.8, 0], [5, 0]]}],
        "furniture": [
            {"category": name, "center": [x, y], "size": [*size], "rotation": 90, "tucked": k == 2}
            for k, (name, x, y, size) in enumerate(items)
        ],
    } | changed


def test_all_is_what_somebody_places_and_the_rest_stays_with_the_chairs_under_it(
    middle: Middle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path, [furnished_room(), furnished_room(id="kitchen", room_type="kitchen")])
    rooms = run(PlaceConfig(by="search", rooms=str(file), move="all"))
    before = furnished_room()["furniture"]
    for room in rooms:
        moved = [k for k in range(6) if room["furniture"][k]["center"] != before[k]["center"]]
        assert moved == [0, 3]  # the bed, and the chair that stands under nothing
    assert middle.seen[0] == [k not in (0, 3) for k in range(6)]  # all else stands, and is in the way
    said = capsys.readouterr().out
    assert "flat: 2 of 2 placed; the plant at 0.5, 4.5 and the plant overlap by more than half" in said
    assert "; nobody places these in a bedroom, and they stay: table, plant (2); what is tucked under them" in said
    assert "stays, too: chair" in said
    assert "placed 4 of 4 items in 2 rooms" in said


def test_what_is_named_and_nobody_places_stays_where_it_was(
    middle: Middle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    document = furnished_room()
    document["furniture"][0] |= {"size": [6.2, 1.5], "center": [3.0, 1.0], "rotation": 0}  # it stands in the walls
    (room,) = run(PlaceConfig(by="search", rooms=str(written(tmp_path, [document])), move="table,bed,chair"))
    assert [item["center"] for item in room["furniture"][:2]] == [[3.0, 1.0], [4.0, 3.0]]
    said = capsys.readouterr().out
    assert "flat: 2 of 4 placed; the bed of 6.2 by 1.5 m is not placed" in said
    assert "the table is not placed: who is asked places no table in a" in said
    assert "they stay" not in said


def test_what_was_wrong_before_is_not_told(middle: Middle, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = furnished_room()
    del document["furniture"][3]["center"]
    document["furniture"][3]["rotation"] = 0
    (room,) = run(PlaceConfig(by="search", rooms=str(written(tmp_path, [document]))))
    assert not any("faults" in item for item in room["furniture"][4:])  # the plants, one in the other
    said = capsys.readouterr().out
    assert "the plant: overlaps" not in said
    assert "the plant at 0.5, 4.5 and the plant overlap by more than half" in said


def test_an_interrupted_run_goes_on_where_it_was(
    middle: Middle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file, _ = many(tmp_path)
    whole = run(PlaceConfig(by="search", rooms=str(file), out=str(tmp_path / "whole.jsonl")))
    seen = interrupted(monkeypatch, 4)
    config = PlaceConfig(by="search", rooms=str(file))
    with pytest.raises(KeyboardInterrupt):
        place(config)
    part = tmp_path / "rooms-placed.jsonl.part"
    with (part / "rooms.jsonl").open("a") as stream:
        stream.write('{"id": "half a ro')  # as a kill would leave it
    with pytest.raises(InputError, match=r"^out: a run was stopped there, with another seed; expected the same, or"):
        place(replace(config, seed=1))
    assert run(config) == whole
    assert seen[4:] == [f"room {k}" for k in range(3, 7)]  # what was done, blocks of one and of two, is not done again
    assert not part.exists()
    assert "goes on after 3 rooms" in capsys.readouterr().out


def test_what_came_by_standard_input_is_not_gone_on_with_as_other_rooms_may_come(
    middle: Middle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, _ = many(tmp_path)
    interrupted(monkeypatch, 4)
    config = PlaceConfig(by="search", rooms="-", out=str(tmp_path / "out.jsonl"))
    monkeypatch.setattr("sys.stdin", TextIOWrapper(BytesIO(file.read_bytes())))
    with pytest.raises(KeyboardInterrupt):
        place(config)
    with pytest.raises(InputError, match=r"^out: a run was stopped there, with another rooms; expected the same, or"):
        place(config)


def test_a_run_that_goes_on_counts_what_is_in_no_room_and_what_is_locked_once(
    middle: Middle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    parked = piece("wardrobe", 900, 100, 100, 54) + piece("cooker", 900, 9, 60, 60)
    for name in "abc":
        home_file(tmp_path / "homes" / f"{name}.sh3d", FLAT + parked)
    bed = DOCUMENTS[0]["furniture"][DOCUMENTS[0]["target"]]
    two = {"furniture": [bed, bed | {"locked": True}], "target": 0}
    documents = [DOCUMENTS[0] | two | {"id": f"room {k}"} for k in range(4)]
    for file, move in ((tmp_path / "homes", None), (written(tmp_path, documents), "bed")):
        config = PlaceConfig(by="search", rooms=str(file), move=move)
        whole = place(replace(config, out=str(tmp_path / f"{file.stem}-whole.jsonl"))).tally
        with monkeypatch.context() as context:
            interrupted(context, 2)
            with pytest.raises(KeyboardInterrupt):
                place(config)
        assert place(config).tally == whole
    said = capsys.readouterr().out
    assert said.count("placed 3 of 6 items") == 2
    assert said.count("move: what is locked stays: bed (4)") == 2


def test_a_full_disk_is_answered_and_the_same_command_goes_on(
    middle: Middle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, _ = many(tmp_path)
    config = PlaceConfig(by="search", rooms=str(file))
    write, written = streams.write_json, []

    def full(path: Path, content: Any) -> None:
        written.append(path)
        if len(written) == 3:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(path, content)

    monkeypatch.setattr(streams, "write_json", full)
    with pytest.raises(InputError, match=r"^out: cannot write .*rooms\.jsonl \(No space left on device\)"):
        place(config)
    assert [room["id"] for room in run(config)] == [f"room {k}" for k in range(7)]


def test_shards_are_all_of_a_file(middle: Middle, tmp_path: Path) -> None:
    file, documents = many(tmp_path)
    shards = [run(PlaceConfig(by="search", rooms=str(file), shard=f"{k}/3")) for k in range(3)]
    assert [len(rooms) for rooms in shards] == [3, 2, 2]
    assert [room["id"] for k in range(7) for room in [shards[k % 3][k // 3]]] == [d["id"] for d in documents]
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == [*(f"rooms-placed-{k}of3.jsonl" for k in range(3)), "rooms.jsonl"]


def test_what_a_folder_is_called_by_is_no_name_for_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "homes" / "inner").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "homes" / "inner")
    for folder in ("..", str(tmp_path / "homes"), "../../homes/"):
        assert layoutrl.place.out_files(PlaceConfig(rooms=folder), ".jsonl") == [tmp_path / "homes-placed.jsonl"]


def test_of_a_name_its_format_alone_is_left_out(tmp_path: Path) -> None:
    (tmp_path / "rooms.v1").mkdir()
    for name in ("rooms.v1", "val.jsonl.gz"):
        (out,) = layoutrl.place.out_files(PlaceConfig(rooms=str(tmp_path / name)), ".jsonl")
        assert out.name == f"{name.removesuffix('.jsonl.gz')}-placed.jsonl"


def test_a_folder_of_homes_is_furnished(middle: Middle, tmp_path: Path) -> None:
    homes = tmp_path / "homes"
    homes.mkdir()
    for name in ("one", "two"):
        home_file(homes / f"{name}.sh3d")
    config = PlaceConfig(by="search", rooms=str(homes), move="all")
    with pytest.raises(InputError, match=r"^out: .* lies in the folder that is read; expected it elsewhere"):
        place(replace(config, out=str(homes / "x.jsonl")))
    assert len(run(config)) > 1


def test_a_list_of_rooms_is_furnished_and_written_a_room_a_line(
    middle: Middle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, documents = many(tmp_path)
    file = tmp_path / "list.json"
    file.write_text(json.dumps(documents, indent=1))
    config = PlaceConfig(by="search", rooms=str(file))
    assert [room["id"] for room in run(config)] == [document["id"] for document in documents]
    assert streams.count(config) == len(documents)
    assert (tmp_path / "list-placed.jsonl").exists()


def test_what_is_written_into_the_folder_of_rooms_is_none_of_them(
    middle: Middle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for k in range(4):
        (tmp_path / f"r{k}.json").write_text(json.dumps(bare(DOCUMENTS[0]) | {"id": f"r{k}"}))
    config = PlaceConfig(by="search", rooms=str(tmp_path), out=str(tmp_path / "x.jsonl"))
    shards = [run(replace(config, shard=f"{k}/2")) for k in range(2)]
    assert [[room["id"] for room in rooms] for rooms in shards] == [["r0", "r2"], ["r1", "r3"]]
    interrupted(monkeypatch, 3)
    with pytest.raises(KeyboardInterrupt):
        place(config)
    assert [room["id"] for room in run(config)] == ["r0", "r1", "r2", "r3"]


def test_a_name_cannot_command_the_terminal(middle: Middle, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = written(tmp_path, [bare(DOCUMENTS[0]) | {"id": "a\x1b[31m"}])
    run(PlaceConfig(by="search", rooms=str(file)))
    said = capsys.readouterr().out
    assert "a\\x1b[31m: " in said
    assert "\x1b" not in said


def test_rooms_are_furnished_where_nobody_listens(
    middle: Middle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, _ = many(tmp_path, 2)
    monkeypatch.setattr("sys.stderr", None)
    monkeypatch.setattr("sys.stdout", None)
    assert len(run(PlaceConfig(by="search", rooms=str(file)))) == 2


@pytest.mark.parametrize(("stream", "given"), [("stdin", {"rooms": "-"}), ("stdout", {"out": "-"})])
def test_a_closed_stream_is_answered(
    stream: str, given: dict[str, str], middle: Middle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, _ = many(tmp_path, 1)
    monkeypatch.setattr(f"sys.{stream}", None)
    with pytest.raises(InputError, match="is closed; expected"):
        place(PlaceConfig(**{"by": "search", "rooms": str(file)} | given))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"drawing": "png"}, "drawing: nothing is drawn as png without pictures=; expected pictures=<folder>"),
        (
            {"move": "bed,bookcas"},
            "move: expected all, or furniture with commas between, as bookcase, .*; got 'bookcas'",
        ),
        ({"by": None, "item": "bookcas"}, "item: expected furniture, as bookcase, .*; got 'bookcas'"),
    ],
)
def test_an_option_that_would_be_ignored_is_refused(given: dict[str, Any], said: str, tmp_path: Path) -> None:
    file, _ = many(tmp_path, 1)
    with pytest.raises(InputError, match=f"^{said}$"):
        place(PlaceConfig(**{"by": "search", "rooms": str(file)} | given))


@pytest.mark.parametrize("option", ["move", "item"])
def test_options_take_the_names_that_furniture_goes_by(
    option: str, middle: Middle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    document = furnished_room() | {"id": "b-17"}
    document["furniture"] = [item for item in document["furniture"] if item["category"] != "bed"]
    bed = {"category": "bed", "size": [2.0, 1.5]} | ({"center": [2.0, 2.0], "rotation": 0} if option == "move" else {})
    document["furniture"].append(bed)
    file = written(tmp_path, [document])
    by = {"by": "search"} if option == "move" else {}
    ours, theirs = (
        place(PlaceConfig(rooms=str(file), out=str(tmp_path / f"{name}.jsonl"), **by | {option: name})).tally
        for name in ("bed", "Bett")
    )
    assert ours == theirs
    assert ours.items > 0
    said = "move: Bett is taken for bed, and all that is one moves\n"
    assert capsys.readouterr().out.count(said) == (option == "move")


def test_an_item_that_no_room_lacks_is_named(middle: Middle, tmp_path: Path) -> None:
    file, _ = many(tmp_path, 1)
    with pytest.raises(
        InputError, match="has no room with a sofa to place; expected furniture without a center, or what"
    ):
        place(PlaceConfig(rooms=str(file), item="sofa"))


def test_an_item_that_is_not_to_move_is_refused_as_the_only_one(middle: Middle, tmp_path: Path) -> None:
    file, _ = many(tmp_path, 1)
    config = PlaceConfig(rooms=str(file), move="bed", item="Schrank")
    with pytest.raises(
        InputError, match="move: bed has no effect with item=wardrobe; expected wardrobe among them, or no move="
    ):
        place(config)
    with pytest.raises(InputError, match="move: bed has no effect with item=Schrank"):
        place(replace(config, run=str(tmp_path)))
    for move in ("all", "bed,wardrobe"):
        assert place(replace(config, move=move, out=str(tmp_path / f"{move}.jsonl"))).tally.items == 1


def test_what_is_to_move_and_is_in_no_room_is_said(
    middle: Middle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path, [furnished_room()])
    run(PlaceConfig(by="search", rooms=str(file), move="bed,bathtub,toilet"))
    assert "move: no room that was read has a bathtub or a toilet" in capsys.readouterr().out.splitlines()
    with pytest.raises(InputError, match="has no room with an armchair to place"):
        run(PlaceConfig(by="search", rooms=str(file), move="armchair", out=str(tmp_path / "other.jsonl")))


def test_the_command_says_what_no_room_has(tmp_path: Path) -> None:
    file = written(tmp_path, [furnished_room()])
    said = command("place", "by=search", f"rooms={file}", "move=armchair", cwd=tmp_path)
    assert said.returncode == 1
    assert "has no room with an armchair to place" in said.stderr


def test_faults_that_are_written_are_those_that_the_room_has_now(middle: Middle, tmp_path: Path) -> None:
    room = furnished_room()
    bed, *_, plant, _ = room["furniture"]
    bed["faults"], plant["faults"] = ["out of reach", "a scratch"], ["overlaps"]
    room["furniture"].append({"category": "bed", "size": [0.6, 1.2]})
    (found,) = run(PlaceConfig(by="search", rooms=str(written(tmp_path, [room]))))
    assert found["furniture"][0] == bed | {"faults": ["a scratch"]}
    assert found["furniture"][4] == plant  # still in the other


@pytest.mark.parametrize("move", ["bed", "all"])
def test_what_is_to_move_and_is_locked_is_said(
    move: str, middle: Middle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    document = furnished_room()
    bed, *others = document["furniture"]
    alone = furnished_room(id="alone", furniture=[bed | {"locked": True}])
    file = written(tmp_path, [document | {"furniture": [bed, *others]}, alone])
    first, second = run(PlaceConfig(by="search", rooms=str(file), move=move))
    assert first["furniture"][0]["center"] != bed["center"]
    assert second == alone
    assert "move: what is locked stays: bed (1)" in capsys.readouterr().out.splitlines()


def test_where_no_room_can_be_read_the_last_line_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "rooms.jsonl"
    file.write_text(json.dumps(DOCUMENTS))
    with pytest.raises(
        InputError, match=r"^rooms: no room of .* could be read, as is said above; expected one or more"
    ):
        place(PlaceConfig(by="search", rooms=str(file)))
    assert capsys.readouterr().out.strip().endswith("; a list of rooms is read from a .json file")


def test_a_document_of_many_lines_on_standard_input_is_refused_after_ten(
    middle: Middle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = json.dumps(DOCUMENTS[0], indent=1)
    monkeypatch.setattr("sys.stdin", TextIOWrapper(BytesIO(text.encode())))
    with pytest.raises(InputError, match=r"^rooms: expected one room a line, in JSON; none of the first 10"):
        place(PlaceConfig(by="search", rooms="-"))
    assert capsys.readouterr().err.count(": left out: ") == 10
    faulty = "\n".join([*['{"id": "a"}'] * 20, json.dumps(bare(DOCUMENTS[0]))])
    monkeypatch.setattr("sys.stdin", TextIOWrapper(BytesIO(faulty.encode())))
    assert place(PlaceConfig(by="search", rooms="-")).tally.rooms == 1


def test_a_jsonl_file_of_one_room_over_many_lines_is_refused_after_ten_and_leaves_nothing(
    middle: Middle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "rooms.jsonl"
    file.write_text(json.dumps(DOCUMENTS[0], indent=1))
    with pytest.raises(
        InputError, match=r"none of the first 10 lines is one \(a room over several lines is a \.json file"
    ):
        place(PlaceConfig(by="search", rooms=str(file)))
    assert capsys.readouterr().out.count(": left out: ") == 10
    assert [path.name for path in tmp_path.iterdir()] == ["rooms.jsonl"]


def test_nothing_of_the_users_is_overwritten(middle: Middle, tmp_path: Path) -> None:
    file, _ = many(tmp_path)
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "cat.png").touch()
    (tmp_path / "rooms-placed.jsonl").touch()
    for given, said in (
        ({}, "out: .* is there already"),
        ({"out": str(file)}, "out: .* is there already"),
        ({"out": str(tmp_path / "new.jsonl"), "pictures": str(tmp_path / "pictures")}, "pictures: .* is not empty"),
        ({"out": str(tmp_path / "new.jsonl"), "pictures": str(file)}, "pictures: .* is a file; expected a new folder"),
    ):
        with pytest.raises(InputError, match=said):
            place(PlaceConfig(by="search", rooms=str(file), **given))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["pictures", "rooms-placed.jsonl", "rooms.jsonl"]
    (tmp_path / "other.jsonl.part").write_text("mine")
    with pytest.raises(InputError, match=r"out: .*other\.jsonl\.part is a file; expected another out=<file>, or that"):
        place(PlaceConfig(by="search", rooms=str(file), out=str(tmp_path / "other.jsonl")))
    assert (tmp_path / "other.jsonl.part").read_text() == "mine"


def test_who_reads_no_room_makes_no_folder_for_pictures(middle: Middle, tmp_path: Path) -> None:
    (tmp_path / "rooms.jsonl").write_text("{}\n")
    with pytest.raises(InputError, match=r"no room of .* could be read"):
        place(PlaceConfig(by="search", rooms=str(tmp_path / "rooms.jsonl"), pictures=str(tmp_path / "pictures")))
    assert not (tmp_path / "pictures").exists()


@pytest.mark.parametrize("drawing", ["svg", "png", "dxf"])
def test_each_layout_is_drawn(drawing: str, middle: Middle, tmp_path: Path) -> None:
    if drawing == "dxf":
        pytest.importorskip("ezdxf")
    file, _ = many(tmp_path, 3)
    run(PlaceConfig(by="search", rooms=str(file), pictures=str(tmp_path / "p"), drawing=drawing))
    assert sorted(path.name for path in (tmp_path / "p").iterdir()) == [f"{k + 1}-room_{k}.{drawing}" for k in range(3)]


def test_a_drawing_says_what_has_no_place(middle: Middle, tmp_path: Path) -> None:
    waterbed = {"category": "waterbed", "size": [2, 2]}
    file = written(tmp_path, [DOCUMENTS[0] | {"furniture": [waterbed]}])
    run(PlaceConfig(by="search", rooms=str(file), pictures=str(tmp_path / "p")))
    (drawn,) = (tmp_path / "p").iterdir()
    assert ">not placed: waterbed</text>" in drawn.read_text()


def test_rooms_come_and_go_by_standard_input_and_output(
    middle: Middle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsysbinary: pytest.CaptureFixture[bytes]
) -> None:
    file, documents = many(tmp_path)
    monkeypatch.setattr("sys.stdin", TextIOWrapper(BytesIO(file.read_bytes())))
    assert place(PlaceConfig(by="search", rooms="-")).files == []
    out, said = capsysbinary.readouterr()
    assert [json.loads(line)["id"] for line in out.splitlines()] == [document["id"] for document in documents]
    assert b"room 0: 4 of 4 placed; the " in said


def test_a_line_of_standard_input_is_answered_before_the_next_is_written(
    middle: Middle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reader, writer = os.pipe()
    answers: Queue[bytes] = Queue()
    got: list[list[str]] = []

    def user() -> None:
        with os.fdopen(writer, "wb") as pipe:
            for several in (1, 1, 3, 2, 1):
                lines = [json.dumps(bare(DOCUMENTS[0]) | {"id": f"{len(got)} {k}"}) for k in range(several)]
                pipe.write(("\n\n".join(lines) + "\n\n").encode())
                pipe.flush()
                got.append([])
                while len(got[-1]) < several:
                    got[-1] += [json.loads(line)["id"] for line in answers.get(timeout=60).splitlines()]

    monkeypatch.setattr("sys.stdout", SimpleNamespace(buffer=SimpleNamespace(write=answers.put, flush=lambda: None)))
    with os.fdopen(reader, "rb") as pipe, ThreadPoolExecutor(1) as pool:
        monkeypatch.setattr("sys.stdin", SimpleNamespace(buffer=pipe))
        done = pool.submit(user)
        place(PlaceConfig(by="search", rooms="-"))
        done.result()
    assert got == [[f"{n} {k}" for k in range(several)] for n, several in enumerate((1, 1, 3, 2, 1))]


def test_the_bar_of_progress_is_there_before_a_room_is_furnished(
    middle: Middle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, _ = many(tmp_path)
    screen = StringIO()
    monkeypatch.setattr(screen, "isatty", lambda: True)
    monkeypatch.setattr("sys.stderr", screen)
    shown: list[str] = []
    furnish = middle.furnish
    monkeypatch.setattr(middle, "furnish", lambda *asked: shown.append(screen.getvalue()) or furnish(*asked))
    run(PlaceConfig(by="search", rooms=str(file)))
    assert "0/7" in shown[0]


def test_what_is_not_placed_or_not_read_is_the_exit_status(
    middle: Middle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    good, large, broken = bare(DOCUMENTS[0]), bare(DOCUMENTS[1]), {"id": "b"}
    large["furniture"][0]["size"] = [99, 99]
    for documents, status in (([good], None), ([good, large], 2), ([good, broken], 2), ([DOCUMENTS[0]], 1)):
        file = written(tmp_path, documents)
        monkeypatch.setattr("sys.argv", ["layoutrl", "by=search", f"rooms={file}"])
        if status is None:
            layoutrl.place.main()
        else:
            with pytest.raises(SystemExit) as ended:
                layoutrl.place.main()
            assert ended.value.code == status or status == 1
        out = tmp_path / "rooms-placed.jsonl"
        assert out.exists() == (status != 1)
        out.unlink(missing_ok=True)
    said, warned = capsys.readouterr()
    assert "error: not everything is placed" in warned
    assert "error: not all rooms could be read" in warned
    assert "rooms.jsonl:2: left out: room 'b': room_type: missing" in said
    assert "; 1 of 2 rooms could not be read, and are not in what is written" in said


@pytest.mark.parametrize("broken", [False, True])
def test_a_home_that_cannot_be_read_is_the_exit_status_and_a_corridor_is_not(
    broken: bool, middle: Middle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    homes = tmp_path / "homes"
    home_file(homes / "flat.sh3d", FLAT + room_tag(0, 400, 600, 500, name="Corridor"))
    if broken:
        (homes / "broken.sh3d").write_bytes(b"no home")
    monkeypatch.setattr("sys.argv", ["layoutrl", "by=search", f"rooms={homes}", "move=bed"])
    if not broken:
        layoutrl.place.main()
        return
    with pytest.raises(SystemExit) as ended:
        layoutrl.place.main()
    assert ended.value.code == 2
    assert (tmp_path / "homes-placed.jsonl").exists()


def test_what_stands_outside_all_rooms_of_a_home_and_stays_is_not_placed(middle: Middle, tmp_path: Path) -> None:
    parked = piece("wardrobe", 900, 100, 100, 54) + piece("cooker", 900, 9, 60, 60)
    home = home_file(tmp_path / "flat.sh3d", FLAT + parked)  # without a kitchen
    tally = place(PlaceConfig(by="search", rooms=str(home))).tally
    assert (tally.placed, tally.items) == (1, 2)


def test_what_finds_no_place_among_the_others_has_no_room(
    middle: Middle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(middle, "layout", lambda brief: brief)
    document = without_place(DOCUMENTS[0])
    (room,) = run(PlaceConfig(by="search", rooms=str(written(tmp_path, [document]))))
    item = room["furniture"][room["target"]]
    assert item["faults"] == ["not placed"]
    assert f"0 of 1 placed; the {item['category']}: not placed, as no room is left for it\n" in capsys.readouterr().out


def test_what_is_said_of_a_room_is_said_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(rival, "DESIGNED", 20)
    document, count = bare(DOCUMENTS[0]), len(DOCUMENTS[0]["furniture"])
    document["furniture"].append({"category": "piano", "size": [1.4, 0.6]})
    run(
        PlaceConfig(
            by="search", search=composed("place", "rooms=-").search, rooms=str(written(tmp_path, [document])), choices=2
        )
    )
    first, second, *_ = capsys.readouterr().out.splitlines()
    assert f"{document['id']}, choice 1: {count} of {count + 1} placed; the piano is not placed: " in first
    assert second.startswith(f"{document['id']}, choice 2: {count} of {count + 1} placed; ")
    assert "piano" not in second


def test_a_rug_is_in_nobodys_way_though_all_is_moved(middle: Middle, tmp_path: Path) -> None:
    document = furnished_room()
    document["furniture"].append({"category": "rug", "center": [3.0, 2.5], "size": [2.0, 3.0]})
    document["furniture"].append({"category": "mat", "center": [3.0, 2.5], "size": [0.3, 0.3]})
    (room,) = run(PlaceConfig(by="search", rooms=str(written(tmp_path, [document])), move="all"))
    assert room["furniture"][-2:] == document["furniture"][-2:]  # the bed is upon both
    assert len(middle.seen[0]) == 6


def test_the_only_rooms_to_furnish_are_named_and_others_stay_as_they_were(
    middle: Middle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, documents = many(tmp_path, 4)
    config = PlaceConfig(by="search", rooms=str(file), only="room 1, room 3, attic")
    rooms = run(config)
    assert [room == document for room, document in zip(rooms, documents, strict=True)] == [True, False, True, False]
    assert len(middle.seen) == 2
    said = capsys.readouterr().out
    assert "only: no room that was read is called attic" in said
    assert "room 0" not in said
    with pytest.raises(InputError, match=r"rooms\.jsonl has no room called attic; expected the id of one"):
        run(replace(config, only="attic", out=str(tmp_path / "out.jsonl")))
    assert not (tmp_path / "out.jsonl").exists()


@pytest.mark.parametrize(
    ("only", "furnished"),
    [
        ("BEDROOM/office", ["a/Bedroom-Office"]),
        ("a/bedroom-office", ["a/Bedroom-Office"]),
        ("Kitchen,dining", ["a/Kitchen, Dining"]),
        ("Salon, Kitchen, Dining", ["a/Kitchen, Dining", "a/Salon"]),
    ],
)
def test_a_room_is_named_as_people_name_it(only: str, furnished: list[str], middle: Middle, tmp_path: Path) -> None:
    names = ("a/Bedroom-Office", "a/Kitchen, Dining", "a/Salon", "a/Dining-Salon")
    documents = [furnished_room(id=name) for name in names]
    rooms = run(PlaceConfig(by="search", rooms=str(written(tmp_path, documents)), move="bed", only=only))
    moved = [room["id"] for room, document in zip(rooms, documents, strict=True) if room != document]
    assert moved == furnished


def test_where_no_room_is_the_one_that_is_asked_for_those_that_are_there_are_named(
    middle: Middle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path, [furnished_room(id=f"flat/Bedroom #{k}") for k in range(25)])
    config = PlaceConfig(by="search", rooms=str(file), move="bed", only="bedroom")
    named = ", ".join(f"flat/Bedroom #{k}" for k in range(20))
    with pytest.raises(InputError, match=rf"has no room called bedroom; expected the id of one: {named}, \.\.\.$"):
        run(config)
    assert "has a bed" not in capsys.readouterr().out


def test_of_the_only_room_it_is_said_why_it_cannot_be_read_and_of_others_no_lock(
    middle: Middle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    locked = furnished_room(id="a")
    locked["furniture"][0]["locked"] = True
    file = written(tmp_path, [locked, furnished_room(id="b")])
    run(PlaceConfig(by="search", rooms=str(file), only="b", move="all", out=str(tmp_path / "out.jsonl")))
    assert "what is locked stays" not in capsys.readouterr().out
    broken = written(tmp_path, [furnished_room(id="b", outline=[])])
    with pytest.raises(InputError, match=r"no room of .* could be read, as is said above"):
        run(PlaceConfig(by="search", rooms=str(broken), only="b", out=str(tmp_path / "x.jsonl")))


def test_that_less_was_wrong_where_all_stood_is_said(
    middle: Middle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bed, desk = (
        {"category": name, "size": [d, w], "rotation": 0} for name, d, w in (("bed", 2, 1), ("desk", 0.6, 1.2))
    )
    rooms = [
        furnished_room(id=name, furniture=[bed | {"center": here}, desk | {"center": there}])
        for name, here, there in (("sound", [1, 1], [0.3, 4]), ("no better", [3, 2.5], [3, 2.5]))
    ]
    run(PlaceConfig(by="search", rooms=str(written(tmp_path, rooms)), move="all"))
    sound, other, _, _ = capsys.readouterr().out.splitlines()
    assert sound.startswith("sound: 2 of 2 placed; the bed: overlaps")
    assert re.search(r"; less was wrong where all stood \(0 instead of [34]\)$", sound)
    assert "less was wrong" not in other
    del rooms[0]["furniture"][0]["center"]
    run(PlaceConfig(by="search", rooms=str(written(tmp_path, rooms)), out=str(tmp_path / "some.jsonl")))
    assert "less was wrong" not in capsys.readouterr().out  # the bed did not stand


@pytest.mark.parametrize("wardrobe", [3.0, 5.0])
def test_what_finds_no_place_and_stays_is_furnished_around(
    wardrobe: float, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    furnisher = NoWardrobe()
    info = FurnisherInfo(furnisher, lambda room_type: ["bed", "wardrobe"])
    monkeypatch.setattr(layoutrl.runs.furnishers, "furnisher_for", lambda config: info)
    document = furnished_room()
    bed, closet = {"category": "bed", "size": [2, 1.5]}, {"category": "wardrobe", "size": [0.6, 1.8]}
    stood = [bed | {"center": [5, 4], "rotation": 0}, closet | {"center": [wardrobe, 2.5], "rotation": 0}]
    file = written(tmp_path, [document | {"furniture": stood}])
    (room,) = run(PlaceConfig(by="search", rooms=str(file), move="all"))
    overlaps = wardrobe == 3.0  # with what comes into the middle
    assert [item["center"] for item in room["furniture"]] == [[1.2 if overlaps else 3.0, 2.5], [wardrobe, 2.5]]
    assert furnisher.seen == [[False, False], [False, True]][: 1 + overlaps]
    said = capsys.readouterr().out
    assert "flat: 1 of 2 placed" in said
    assert "the wardrobe: not placed, as no room is left for it, and stays where it stood" in said
    assert "overlaps" not in said
    assert room["furniture"][1]["faults"] == ["not placed"]


def test_of_what_is_found_around_what_stays_the_best_is_taken_and_no_choice_is_lost(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    bed, closet = {"category": "bed", "size": [2, 1.5]}, {"category": "wardrobe", "size": [0.6, 1.8]}
    stood = [bed | {"center": [5, 4], "rotation": 0}, closet | {"center": [3, 2.5], "rotation": 0}]
    stood += [bed | {"center": [1, 4], "rotation": 0, "locked": True}]
    file = written(tmp_path, [furnished_room(furniture=stood)])

    def beds(beside: tuple[float, float] | None, out: str) -> list[list[float]]:
        info = FurnisherInfo(NoWardrobe(beside), lambda room_type: ["bed", "wardrobe"])
        monkeypatch.setattr(layoutrl.runs.furnishers, "furnisher_for", lambda config: info)
        rooms = run(PlaceConfig(by="search", rooms=str(file), move="all", choices=2, out=str(tmp_path / out)))
        return [room["furniture"][0]["center"] for room in rooms]

    assert beds((1.2, 2.5), "better.jsonl") == [[1.2, 2.5], [3.0, 2.5]]  # and the first, in the wardrobe, is kept
    assert beds((1.0, 4.0), "as_bad.jsonl") == [[3.0, 2.5], [1.0, 4.0]]  # in the other bed
    assert beds(None, "nothing.jsonl") == [[5, 4], [3.0, 2.5]]  # it has no place, and so stays, but overlaps nothing


@pytest.mark.parametrize("named", ["move=rug", "item=Teppich"])
def test_nobody_places_a_rug(named: str, middle: Middle, tmp_path: Path) -> None:
    option, _, name = named.partition("=")
    config = PlaceConfig(rooms=str(written(tmp_path, [furnished_room()])))
    with pytest.raises(InputError, match=rf"^{option}: expected .*; got '{name}'"):
        run(replace(config, **{option: name}))


def test_of_a_home_one_room_is_furnished_by_its_name_alone(middle: Middle, tmp_path: Path) -> None:
    home = home_file(tmp_path / "flat.sh3d", FLAT + piece("cooker", 900, 9, 60, 60))
    config = PlaceConfig(by="search", rooms=str(home), move="all", only="Bedroom", out=str(tmp_path / "out.sh3d"))
    tally = place(config).tally
    assert (tally.rooms, tally.items) == (1, 1)  # the cooker, which no room is for, was not asked about
    before, after = (opened(path, move="").collection.rooms for path in (home, tmp_path / "out.sh3d"))
    assert [one.furniture == other.furniture for one, other in zip(before, after, strict=True)] == [False, True]


def test_a_room_of_a_home_that_is_left_out_is_asked_for_in_vain_and_no_matter_to_others(
    middle: Middle, tmp_path: Path
) -> None:
    home = home_file(tmp_path / "flat.sh3d", FLAT + room_tag(0, 500, 300, 800, name="room 10"))
    config = PlaceConfig(by="search", rooms=str(home), move="all", only="Bedroom", out=str(tmp_path / "out.sh3d"))
    assert place(config).tally.unread == 0
    assert place(replace(config, only=None, out=str(tmp_path / "all.sh3d"))).tally.unread == 1
    (folder := tmp_path / "homes").mkdir()
    home_file(folder / "flat.sh3d")
    (folder / "broken.sh3d").write_bytes(b"may hold a bedroom, too")
    assert place(replace(config, rooms=str(folder), out=str(tmp_path / "homes.jsonl"))).tally.unread == 1
    with pytest.raises(
        InputError, match=r"^rooms: flat/room 10 is left out: nothing tells its type.*; expected the id"
    ):
        place(replace(config, only="Room 10", out=str(tmp_path / "none.sh3d")))


def test_what_falls_to_a_room_that_is_not_asked_for_is_not_said(
    middle: Middle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    parked = piece("wardrobe", 900, 100, 100, 54) + piece("shower", 900, 400, 80, 80)
    home = home_file(tmp_path / "flat.sh3d", FLAT + parked)
    place(PlaceConfig(by="search", rooms=str(home), only="Bedroom", out=str(tmp_path / "out.sh3d")))
    said = capsys.readouterr().out
    assert "flat/Bedroom: gets wardrobe from outside all rooms" in said
    assert "flat/room 2: " not in said
    untold = furnished_room(id="x", furniture=[])
    del untold["room_type"]
    rooms = str(written(tmp_path, [untold, furnished_room()]))
    place(PlaceConfig(by="search", rooms=rooms, only="flat", move="chair", room_type="study"))
    assert "x: " not in capsys.readouterr().out


def test_what_a_home_has_nowhere_counts_once_and_where_it_is_asked_for(middle: Middle, tmp_path: Path) -> None:
    parked = piece("wardrobe", 900, 100, 100, 54) + piece("cooker", 900, 9, 60, 60)
    config = PlaceConfig(by="search", rooms=str(home_file(tmp_path / "flat.sh3d", FLAT + parked)))
    shards = [place(replace(config, shard=f"{k}/2", out=str(tmp_path / "x.sh3d"))).tally for k in range(2)]
    assert sum(tally.items for tally in shards) == 2
    tally = place(replace(config, by=None, item="wardrobe", out=str(tmp_path / "y.sh3d"))).tally
    assert (tally.placed, tally.items) == (1, 1)


def test_rooms_in_memory_are_furnished_as_those_of_a_file(
    middle: Middle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, documents = many(tmp_path)
    written_rooms = run(PlaceConfig(by="search", rooms=str(file)))
    said = capsys.readouterr().out
    answers = furnish([room_from_dict(document) for document in documents], by="search")
    for answer, document, room in zip(answers, documents, written_rooms, strict=True):
        (layout,), (wrong,) = answer.layouts, answer.wrong
        assert with_layout(document, answer.request.checked.room, layout, wrong, ()) == room
        (told,) = answer.documents()
        assert told["furniture"] == room["furniture"]
        assert "\n".join(answer.lines()) in said
    (none,) = furnish([room_from_dict(DOCUMENTS[0])], by="search")
    assert not [*none.lines()]
    assert none.layouts == [room_from_dict(DOCUMENTS[0])]
    (moved,) = furnish([room_from_dict(DOCUMENTS[0])], by="search", move="bed")
    assert [k for k, item in enumerate(moved.layouts[0].furniture) if item.category == "bed"] == moved.request.wanted


def test_what_nobody_places_stays_where_it_stood_though_it_was_lifted(middle: Middle) -> None:
    room = room_from_dict(furnished_room())
    for lifted, options in ((room, {"move": "table,bed"}), (to_place(room, "table,bed"), {"stood": [room.furniture]})):
        (answer,) = furnish([lifted], by="search", **options)
        assert answer.layouts[0].furniture[1:] == room.furniture[1:]
        assert answer.layouts[0].furniture[0].center not in (None, room.furniture[0].center)


def test_of_rooms_in_memory_one_kind_of_item_is_placed_where_it_alone_is_asked_for() -> None:
    room = room_from_dict(furnished_room())
    room = replace(room, furniture=(*room.furniture, Item("wardrobe", (0.6, 1.0), None, None)))
    (answer,) = furnish([room], item="Schrank", move="all", device="cpu")
    assert answer.request.wanted == [len(room.furniture) - 1]
    lacking = replace(room, furniture=tuple(replace(item, center=None) for item in room.furniture))
    (answer,) = furnish([lacking], item="wardrobe")
    assert f"; {len(room.furniture) - 1} more have no place, and were not asked for" in next(answer.lines())
    (answer,) = furnish([room], by="search", seconds=0.5)
    assert answer.request.wanted == [len(room.furniture) - 1]


def test_of_rooms_with_stood_only_what_lost_its_center_is_placed(middle: Middle) -> None:
    room = room_from_dict(furnished_room())
    (answer,) = furnish([to_place(room, "bed,table")], stood=[room.furniture], move="all")
    assert answer.request.wanted == [0]  # not the chair, which nobody lifted; the table, which nobody places, stays
    assert answer.layouts[0].furniture[1:] == room.furniture[1:]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"choices": 0}, "choices: expected 1 to"),
        ({"by": "magic"}, "by: expected"),
        ({"by": "search", "run": "runs/x"}, "run: expected either"),
        ({"move": "sofaa"}, "move: expected all, or furniture with commas between, as sofa"),
        ({"run": "nowhere"}, "nowhere"),
        ({"run": Path("nowhere")}, "nowhere"),
        ({"run": 5}, "run: expected text"),
        ({"move": ["bed"]}, "move: expected text"),
        ({"choices": "3"}, "choices: expected a whole number; got '3'"),
        ({"choices": 2.5}, "choices: expected a whole number"),
        ({"seed": None}, "seed: expected a whole number"),
        ({"item": "sofaa"}, "item: expected furniture, as sofa"),
        ({"item": "bed,wardrobe"}, "item: expected one kind of furniture; got bed,wardrobe; move= takes several"),
        ({"by": "search", "seconds": 10**400}, "seconds: expected more than 0"),
        ({"by": "search", "seconds": np.float32(-1)}, "seconds: expected more than 0"),
        ({"item": "bed", "move": "desk"}, "move: desk has no effect with item=bed"),
        ({"seconds": 2.0}, "seconds: they are of by=search and by=annealer"),
        ({"by": "search", "seconds": "2"}, "seconds: expected a number; got '2'"),
        ({"by": "search", "seconds": -1}, "seconds: expected"),
        ({"by": "search", "device": "cuda"}, "device: by=search works on the CPU alone"),
        ({"device": 0}, "device: expected text"),
        ({"stood": []}, "stood: expected the furniture of each room"),
        ({"stood": [[]]}, "stood: expected the furniture of each room"),
    ],
)
def test_what_cannot_be_asked_of_rooms_in_memory_is_told(options: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        furnish([room_from_dict(DOCUMENTS[0])], **options)


@pytest.mark.parametrize(
    ("size", "outline", "said"),
    [
        ((-2.0, 1.5), (), "^built: furniture.0..size: expected two lengths above zero"),
        ((2.0, float("nan")), (), "^built: furniture.0..size: expected a finite number"),
        ((2.0, 1.5), ((0, 0), (5, 0), (0, 4), (5, 4)), "^built: outline: expected a simple polygon"),
        ([2.0, 1.5], (), "^built: expected tuples of numbers"),
    ],
)
def test_a_room_that_is_built_is_checked_as_one_that_is_read(size: Any, outline: Any, said: str) -> None:
    room = rectangular_room(5, 4, Item("bed", size), target=None)
    with pytest.raises(InputError, match=said):
        furnish([replace(room, id="built", outline=outline or room.outline)], by="search")


def test_rooms_of_a_home_are_furnished_in_memory_though_their_sizes_are_rounded(middle: Middle, tmp_path: Path) -> None:
    bed = piece("bed140x190", 100, 104, 158.000046, 208.000046, id="bed")
    source = opened(home_file(tmp_path / "flat.sh3d", FLAT.replace(BED, bed)), move="all")
    (stood, *_), (room, *_) = source.stood, source.collection.rooms
    assert stood[0].size != room.furniture[0].size
    answers = furnish(source.collection.rooms, stood=source.stood, move="all", by="search")
    assert 0 in answers[0].request.wanted


@pytest.mark.parametrize("rooms", [DOCUMENTS, room_from_dict(DOCUMENTS[0]), "my_rooms.json"])
def test_what_is_furnished_in_memory_is_a_list_of_rooms(rooms: Any) -> None:
    with pytest.raises(InputError, match=r"^rooms: expected a list of rooms, as read_rooms\(file\)\.rooms is; got .+"):
        furnish(rooms)


def test_options_are_composed_once_for_rooms_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    furnish([], by="search")
    monkeypatch.setattr("layoutrl.place.composed", None)
    assert furnish([room_from_dict(DOCUMENTS[0])], by="agents")[0].request.wanted == []


def test_no_more_of_a_file_is_in_memory_than_a_block(
    middle: Middle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsysbinary: pytest.CaptureFixture[bytes]
) -> None:
    line = json.dumps(bare(DOCUMENTS[0])).encode() + b"\n"
    read = []

    class Endless:
        def read1(self, size: int) -> bytes:
            if len(read) == 20:
                raise KeyboardInterrupt
            read.append(line)
            return line

    monkeypatch.setattr("sys.stdin", SimpleNamespace(buffer=Endless()))
    with pytest.raises(KeyboardInterrupt):
        place(PlaceConfig(by="search", rooms="-"))
    assert len(capsysbinary.readouterr().out.splitlines()) == 20


@pytest.mark.parametrize("shard", ["8/8", "1", "a/b", "-1/8"])
def test_a_shard_that_is_none_is_refused(shard: str) -> None:
    with pytest.raises(InputError, match=r"^shard: expected one of 0/8"):
        composed("place", "by=search", "rooms=rooms.jsonl", f"shard='{shard}'")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("rooms=", "rooms: expected a name; it is empty"),
        ("rooms=", "it is empty$"),
        ("pictures=", "pictures: expected a name; it is empty"),
        ("item=", "item: expected a name; it is empty"),
        ("choices=21", "choices: expected 1 to 20"),
        ("seconds=inf", "seconds: expected more than 0, 3600 at most"),
        ("shard='0/2,1/2'", "; several need -m"),
        ("only=", "only: expected the id of a room, or several with commas between"),
        ("only='Bedroom,'", "only: expected the id of a room, or several with commas between"),
    ],
)
def test_what_cannot_be_meant_is_refused(given: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        composed("place", "rooms=rooms.jsonl", given)


def test_what_is_nobodys_home_is_no_file() -> None:
    with pytest.raises(InputError, match="~nobody-at-all"):
        run(PlaceConfig(rooms="~nobody-at-all/rooms.jsonl"))
