"""python -m layoutrl.bench, on little: every part runs, and measures what it says."""

from __future__ import annotations

import contextlib
import io
import json
from dataclasses import fields
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from layoutrl import InputError, bench
from layoutrl.benchmarks import simulation
from layoutrl.benchmarks.curves import Curve, held_out_probe, learned_by_sb3
from layoutrl.benchmarks.learning import bare_passes, fill, untrained
from layoutrl.benchmarks.parts import ROWS
from layoutrl.benchmarks.simulation import with_items
from layoutrl.rooms.room import Item, Room
from layoutrl.rooms.sources.parts import read_parts
from layoutrl.runs.config import BenchConfig, composed
from tests.builders import rooms
from tests.commands import SERVER, layoutrl

LITTLE = (
    "budget=smoke", "seconds=0.01", "batch=64", "images=8", "shapely_batches=[4,8]", "transitions=2000",
    "batches=[1,64]", "items=[2,8]", "items_rooms=4", "requests=3", "clients=4", "probe_every=10", "minutes=0.002",
    "data.train_rooms=8", "data.test_rooms=2", "method.updates={smoke: 20}", "method.batch=64",
    "method.warmup_moves=128", "method.replay_capacity=2000", "method.evaluation_moves=5",
    "paper.batch=16", "paper.warmup_moves=64", "paper.replay_capacity=100", "name=little",
)  # fmt: skip
DEMO = "demo," if find_spec("starlette") and find_spec("uvicorn") else ""
HAS_SB3 = find_spec("stable_baselines3") is not None
CPU = torch.device("cpu")


def configured(*overrides: str) -> BenchConfig:
    config = composed("bench", *LITTLE, *overrides)
    assert isinstance(config, BenchConfig)
    return config


@pytest.mark.parametrize("name", ["method", "paper"])
def test_what_learns_from_every_move_is_not_compared(name: str) -> None:
    expected = f"^{name} of bench: expected one that learns from the moves made; got paper_every_move$"
    with pytest.raises(InputError, match=expected):
        configured("method=paper_every_move" if name == "method" else "method@paper=paper_every_move")


def test_what_it_would_ignore_is_refused() -> None:
    with pytest.raises(InputError, match="a fourth term"):
        configured("reward=usable")


def test_what_a_part_lacks_is_said_before_anything_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given = "room=balcony", f"runs={tmp_path}", f"data.root={tmp_path / 'rooms'}", "device=cpu"
    with pytest.raises(InputError, match=r"^parts: speed expects rooms with 5 items or more; no balcony has them$"):
        bench.run(configured("parts=[growth,speed]", *given))
    assert not (tmp_path / "bench").exists()
    monkeypatch.setattr("layoutrl.bench.two_parts", None)  # rooms are not made yet
    with monkeypatch.context() as patch:
        patch.setattr("layoutrl.benchmarks.learning.resident_bytes", lambda *_, **__: None)
        with pytest.raises(InputError, match="parts: memory expects Linux"):
            bench.run(configured("parts=[growth,memory]", *given))
    with monkeypatch.context() as patch:
        patch.setattr("layoutrl.benchmarks.serving.find_spec", lambda _: None)
        with pytest.raises(InputError, match="parts: demo needs starlette and uvicorn"):
            bench.run(configured("parts=[growth,demo]", *given))
        patch.setattr("layoutrl.benchmarks.serving.find_spec", lambda name: name)
        patch.setattr("layoutrl.runs.pretrained.cards", lambda: {"bedroom": {}})
        with pytest.raises(InputError, match="no agent furnishes a balcony; expected one of bedroom"):
            bench.run(configured("parts=[growth,demo]", *given))


@pytest.fixture(scope="module")
def benched(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """The table and the folder. The process of its own is forked: a new interpreter would import for seconds."""
    cwd, printed, begun = tmp_path_factory.mktemp("bench"), io.StringIO(), list[str]()
    given = (
        f"parts=[speed,rooms,memory,growth,{DEMO}training,image]",
        "device=cpu",
        f"runs={cwd}",
        f"data.root={cwd / 'rooms'}",
    )
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed):
        patch.setattr("multiprocessing.get_context", lambda how: begun.append(how) or SERVER)
        folder = bench.run(configured(*given))
    assert begun == ["spawn"]  # for the memory alone
    return printed.getvalue(), folder


def test_the_command_prints_its_table(tmp_path: Path) -> None:
    done = layoutrl("bench", *LITTLE, "parts=[growth]", "device=cpu", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert ROWS["growth"]["moves_a_second_by_items"][0] in done.stdout
    assert done.stdout.splitlines()[-1] == f"wrote {Path('runs') / 'bench' / 'little'}"


GOALS = ("minutes_to_goal", "times_sb3", "slowest_seconds")  # that may not be reached, or asked for


def test_every_row_of_the_table_is_measured(benched: tuple[str, Path]) -> None:
    printed, folder = benched
    measured = json.loads((folder / "bench.json").read_text())
    for part in measured.keys() - {"machine", "config"}:
        for key, (what, _) in ROWS[part].items():
            if key not in ("peak_device_gigabytes", "picture_seconds", "megabytes"):  # not on every machine
                assert numbers(measured[part][key], or_none=key in GOALS), key
                assert what in printed
    assert {"cpu", "cores", "torch threads", "python", "torch", "shapely", "layoutrl"} <= measured["machine"].keys()
    assert measured["config"]["seconds"] == 0.01


def numbers(value: Any, *, or_none: bool = False) -> bool:
    """Whether all are numbers above zero."""
    if isinstance(value, dict):
        return len(value) > 0 and all(numbers(each, or_none=or_none) for each in value.values())
    return or_none if value is None else value > 0


def test_growth_is_drawn(benched: tuple[str, Path]) -> None:
    with Image.open(benched[1] / "growth.png") as picture:
        assert picture.size == (1080, 420)


def test_training_with_a_full_replay_is_measured_in_a_process_of_its_own(benched: tuple[str, Path]) -> None:
    measured = json.loads((benched[1] / "bench.json").read_text())["memory"]
    assert measured["bytes_a_transition"] == 33
    assert 0.1 < measured["peak_gigabytes"] < 1.5


@pytest.mark.parametrize("double", [True, False])
def test_the_bare_passes_are_those_of_an_update(double: bool, tmp_path: Path) -> None:
    config = configured(f"method.double={double}", f"data.root={tmp_path}")
    learner = untrained(config, read_parts(config.room.type, config.room.item, config.data, config.fold)[0], CPU)
    fill(learner)
    reports = iter(learner.training(1))
    next(reports)
    calls: list[tuple[str, tuple[int, ...], bool]] = []
    for name in ("network", "target"):
        module = getattr(learner.dqn, name)
        module.register_forward_hook(
            lambda _, inputs, output, name=name: calls.append((name, inputs[0].shape, output.requires_grad))
        )
    first = next(learner.dqn.network.parameters())
    first.register_post_accumulate_grad_hook(lambda _: calls.append(("backward", (), True)))
    next(reports)
    update = calls[1:]  # the first is to act
    calls.clear()
    bare_passes(learner)()
    assert sorted(calls) == sorted(update)
    assert len(calls) == (4 if double else 3)


def test_measures_are_timed_once_in_layouts_of_which_nothing_is_known(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    config = configured(f"data.root={tmp_path}")
    training, held_out = read_parts(config.room.type, config.room.item, config.data, config.fold)
    asked: list[list[Room]] = []
    monkeypatch.setattr(simulation, "measured", lambda layouts, _: asked.append(layouts))
    simulation.furnishing(config, training, held_out, CPU)
    (layouts,) = asked
    assert layouts == list(held_out)
    known = {field.name for field in fields(Room)}, {field.name for field in fields(Item)}
    assert all(vars(layout).keys() == known[0] for layout in layouts)
    assert all(vars(item).keys() == known[1] for layout in layouts for item in layout.furniture)


@given(room=rooms(), count=st.integers(1, 30), seed=st.integers(0, 100))
def test_rooms_get_as_many_items_as_asked_for(room: Room, count: int, seed: int) -> None:
    crowded = with_items(room, count, np.random.default_rng(seed))
    assert len(crowded.furniture) == 1 + len(crowded.others) == count
    assert crowded.moving == room.moving
    assert all(room.indoor.covers(item.footprint) for item in crowded.furniture if item.category == "box")


def test_what_the_probing_takes_is_not_training(monkeypatch: pytest.MonkeyPatch) -> None:
    ious, clock = iter([0.1, 0.9, 0.8]), [0.0]
    monkeypatch.setattr("time.perf_counter", lambda: clock[0])

    def probe(_: object) -> tuple[dict[str, float], list[np.ndarray]]:
        clock[0] += 1000
        return {"iou": next(ious)}, []

    curve = Curve(probe)
    for updates in (1, 2, 3):
        clock[0] += 60
        curve.add(updates, None)
    assert [(point.updates, point.seconds) for point in curve.points] == [(1, 60), (2, 120), (3, 180)]
    assert curve.minutes_to(0.85) == 2
    assert curve.minutes_to(0.95) is None


@pytest.mark.skipif(HAS_SB3, reason="Stable-Baselines3 is there")
def test_where_sb3_is_missing_one_line_says_how_to_install_it(tmp_path: Path) -> None:
    done = layoutrl("bench", *LITTLE, "parts=[speed,sb3]", cwd=tmp_path)
    assert done.returncode != 0
    assert "pip install stable-baselines3" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not list(tmp_path.iterdir())  # before anything is measured


@pytest.mark.skipif(not HAS_SB3, reason="Stable-Baselines3 (extra bench) is not installed")
def test_sb3_trains_our_network_for_as_many_updates(tmp_path: Path) -> None:
    config = configured(f"data.root={tmp_path}", "method.target_period=10")
    training, held_out = read_parts(config.room.type, config.room.item, config.data, config.fold)
    learner = untrained(config, training, CPU, updates=25)
    before = [weights.clone() for weights in learner.dqn.network.parameters()]
    curve = learned_by_sb3(config, training, learner, held_out_probe(config, training, held_out, CPU))
    assert [point.updates for point in curve.points] == [10, 20, 25]
    agent = learner.dqn
    triples = list(zip(before, agent.network.parameters(), agent.target.parameters(), strict=True))
    assert all(not torch.equal(old, new) for old, new, _ in triples)
    assert all(not torch.equal(old, target) and not torch.equal(new, target) for old, new, target in triples)


def test_rooms_that_cannot_be_read_leave_no_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere"):
        bench.run(configured("data=json", "data.root=nowhere.jsonl", f"runs={tmp_path}"))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("argument", "words"),
    [
        ("parts=[sped]", ["parts", "speed", "sb3"]),
        ("parts=[]", ["parts: expected one or more of speed", "sb3"]),
        ("batches=[]", ["batches", "1 or more"]),
        ("items=[0]", ["items", "1 or more"]),
        ("seconds=0", ["seconds", "more than 0"]),
        ("transitions=10", ["transitions", "a batch"]),
        ("paper.batch=0", ["paper.batch", "1 or more"]),
        ("method=paper", ["method", "another than paper"]),
        ("device=cuda:99", ["device", "cuda:99"]),
        ("runs=/dev/null", ["runs", "/dev/null"]),
    ],
)
def test_what_the_user_got_wrong_is_answered(argument: str, words: list[str]) -> None:
    with pytest.raises(InputError) as error:
        bench.run(configured(argument))
    assert all(word in str(error.value) for word in words), error
