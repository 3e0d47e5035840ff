"""What an agent cannot place is left out, with the reason."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import layoutrl.place
from layoutrl import InputError
from layoutrl.evaluation.protocols import Greedy, Rollout, greedy
from layoutrl.place import run
from layoutrl.rivals.rooms.annealer import MOVES
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.files import room_to_dict
from layoutrl.runs.config import PlaceConfig, TrainConfig, composed, part
from layoutrl.train import run as train
from tests.runs.test_resume import SHORT

DOCUMENTS = [room_to_dict(room) for room in design_rooms("bedroom", "test", 3, 3).rooms]


@pytest.fixture(scope="module")
def agent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """That moves every item."""
    folder = tmp_path_factory.mktemp("agent")
    rooms = written(folder, [room_to_dict(room) for room in design_rooms("bedroom", "train", 0, 8).rooms])
    given = ("room=bedroom", "room.item=all", "data=json", f"data.root={rooms}", f"runs={folder}")
    few = ("method.updates.smoke=2", "budget.evaluations=1", "budget.reports=1")
    return train(part(composed("train", *given, *SHORT, *few), TrainConfig))


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


def test_an_item_that_the_agent_does_not_know_is_left_out_and_other_furniture_is_no_matter(
    agent: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    strange, known, beside = (without_place(document) for document in DOCUMENTS)
    strange["furniture"][strange["target"]]["category"] = "waterbed"
    other = next(k for k in range(len(beside["furniture"])) if k != beside["target"])
    beside["furniture"][other]["category"] = "totem"
    file = written(tmp_path, [strange, known, beside])
    placed = run(PlaceConfig(run=str(agent), rooms=str(file), device="cpu"))
    ids = [json.loads(line)["id"] for line in placed.read_text().splitlines()]
    assert ids == [known["id"], beside["id"]]
    said = capsys.readouterr().out
    assert "left out 1: the agent knows no waterbed, but bed, chair, desk, " in said


def test_an_item_without_rotation_faces_where_its_value_is_highest(
    agent: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    document = without_place(DOCUMENTS[0])
    del document["furniture"][document["target"]]["rotation"]
    given = without_place(DOCUMENTS[1], rotation=180)
    written(tmp_path, [document, given])

    def rotations(facing: int) -> list[float]:
        class Best(Greedy):
            def rollout(self, *args: Any) -> Rollout:
                found = super().rollout(*args)
                assert len(found.room) == 5  # four ways, and the one that is given
                found.value[found.moves, np.arange(5)] = np.arange(5) == facing
                return found

        monkeypatch.setattr(
            "layoutrl.evaluation.protocols.greedy", lambda agent, method: Best(**vars(greedy(agent, method)))
        )
        out = tmp_path / f"{facing}.jsonl"
        run(PlaceConfig(run=str(agent), rooms=str(tmp_path / "rooms.jsonl"), out=str(out), device="cpu"))
        rooms = [json.loads(line) for line in out.read_text().splitlines()]
        return [room["furniture"][room["target"]]["rotation"] for room in rooms]

    assert [rotations(facing) for facing in range(4)] == [[90.0 * facing, 180.0] for facing in range(4)]


@pytest.mark.parametrize("by", ["search", "annealer"])
def test_without_an_agent_all_that_has_no_center_is_placed_and_what_cannot_be_is_named(
    by: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(layoutrl.place, "DESIGNED", 20)
    documents = [json.loads(json.dumps(document)) for document in DOCUMENTS]
    for document in documents[:2]:
        for item in document["furniture"]:
            del item["center"], item["rotation"]
    documents[1]["furniture"][0] |= {"category": "waterbed"}
    documents[1]["furniture"][1]["size"] = [9, 9]
    file = written(tmp_path, documents)
    placed = run(composed("place", f"by={by}", f"rooms={file}", "seconds=0.1"))
    rooms = [json.loads(line) for line in placed.read_text().splitlines()]
    assert [room["id"] for room in rooms] == [document["id"] for document in documents[:2]]
    assert all({"center", "rotation"} <= item.keys() for item in rooms[0]["furniture"])
    assert [k for k, item in enumerate(rooms[1]["furniture"]) if "center" not in item] == [0, 1]
    said = capsys.readouterr().out
    assert f"{rooms[1]['id']}: the waterbed is not placed: nobody knows it; expected a category as " in said
    assert f"the {documents[1]['furniture'][1]['category']} of 9 by 9 m is not placed: it fits into the room" in said


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
    for given in ((), ("by=search", "run=runs/bedroom/some")):
        with pytest.raises(InputError, match=r"^run: expected either run=<folder> of a training, or by=search"):
            run(composed("place", *given, f"rooms={file}"))
    with pytest.raises(InputError, match="has no room with an item without a center"):
        run(composed("place", "by=search", f"rooms={file}"))


def test_where_nothing_is_placed_the_last_line_says_why(agent: Path, tmp_path: Path) -> None:
    whole, strange, large = DOCUMENTS[0], without_place(DOCUMENTS[1]), without_place(DOCUMENTS[2], size=[99, 99])
    strange["furniture"][strange["target"]]["category"] = "waterbed"
    file = written(tmp_path, [whole, strange, large])
    with pytest.raises(InputError, match=rf"^rooms: {file} has no bedroom to work on: .*$") as caught:
        run(PlaceConfig(run=str(agent), rooms=str(file), device="cpu"))
    said = str(caught.value)
    assert f"left out 1: expected one item without a center; got 0 ({whole['id']}); " in said
    assert "left out 1: the agent knows no waterbed, but " in said
    assert f"left out 1: the bed does not fit into it ({large['id']}); " in said
