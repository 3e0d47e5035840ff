"""The entry points as a user runs them: python -m layoutrl.train, .evaluate, .place, .watch and .gallery."""

from __future__ import annotations

import csv
import json
import re
import shutil
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import torch
from omegaconf import OmegaConf
from PIL import Image
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.plugins.hparams.plugin_data_pb2 import HParamsPluginData

from layoutrl.env.batch import BatchSimulator
from layoutrl.env.observation import observation_of
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Simulator
from layoutrl.evaluation.moving import STARTS_PER_FACING
from layoutrl.evaluation.placing import spread
from layoutrl.evaluation.policy import greedy
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.documents import room_from_dict, room_to_dict
from layoutrl.rooms.furnished import rng_of
from layoutrl.runs.checkpoints import checkpoints
from layoutrl.runs.config import TrainConfig, config_directory
from layoutrl.runs.folder import load_config
from layoutrl.runs.trained import kept_agent
from tests.commands import PROJECT, fresh, layoutrl

CPU = torch.device("cpu")
ROOMS = sorted(path.stem for path in (config_directory() / "room").glob("*.yaml"))
LITTLE = (
    "budget=smoke", "budget.evaluations=1", "method.updates.smoke=8", "method.batch=64", "method.warmup_moves=128",
    "method.evaluation_moves=5",
)  # fmt: skip
FEW_PICTURES = "budget.evaluation_rooms=1"
FEW = ("data.train_rooms=8", "data.test_rooms=2", FEW_PICTURES)
BUDGETS = ("scene", "smoke", "default", "full")
TIMES = ("seconds", "ms_a_start", "training_seconds", "machine")


def trained(cwd: Path, *arguments: str) -> Path:
    done = layoutrl("train", *LITTLE, *arguments, cwd=cwd)
    assert done.returncode == 0, done.stderr
    return cwd / done.stdout.splitlines()[-1].removeprefix("wrote ")


def metrics(run: Path) -> list[dict[str, str]]:
    with (run / "metrics.csv").open() as file:
        return [{k: v for k, v in row.items() if not k.startswith(TIMES)} for row in csv.DictReader(file)]


def evaluation(run: Path) -> dict:
    return {k: v for k, v in json.loads((run / "evaluation.json").read_text()).items() if k not in TIMES}


@pytest.fixture(scope="module")
def bedroom_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return trained(tmp_path_factory.mktemp("bedroom"), "room=bedroom")


def test_the_eight_room_types_of_the_paper_have_a_config() -> None:
    expected = "balcony bathroom bedroom dining_room kitchen living_room study tatami"
    assert expected.split() == ROOMS


@pytest.mark.parametrize("room", ROOMS)
def test_every_room_trains_and_is_scored_from_any_working_directory(room: str, tmp_path: Path) -> None:
    run = trained(tmp_path, f"room={room}", *FEW)
    assert run == tmp_path / "runs" / room / "designer-main-geometric-smoke-seed0"
    assert OmegaConf.load(run / "config.yaml").room.type == room
    assert checkpoints(run)[0].file.stat().st_size > 10_000
    rows = metrics(run)
    assert int(rows[-1]["updates"]) == 8
    assert 0 <= float(rows[-1]["iou_held_out"]) <= 1
    result = evaluation(run)
    assert result["rooms"] == 2
    assert result["rows"].keys() == {
        "agent", "random start", "random wall or corner place", "nearest training room",
    }  # fmt: skip
    assert all(row["mean_iou"] <= result["lattice_ceiling"] for row in list(result["rows"].values())[:2])


def test_the_papers_method_trains_on_pictures(tmp_path: Path) -> None:
    run = trained(tmp_path, "room=bathroom", "method=paper", "method.batch=16", *FEW)
    assert float(metrics(run)[-1]["loss"]) > 0


def test_the_same_seed_gives_the_same_metrics_and_another_seed_others(bedroom_run: Path, tmp_path: Path) -> None:
    """Also in a new interpreter."""
    done = fresh("-m", "layoutrl.train", *LITTLE, "room=bedroom", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    again = tmp_path / done.stdout.splitlines()[-1].removeprefix("wrote ")
    assert metrics(again) == metrics(bedroom_run)
    assert evaluation(again) == evaluation(bedroom_run)
    assert metrics(trained(tmp_path, "room=bedroom", "seed=1")) != metrics(bedroom_run)


def test_a_new_interpreter_answers_what_a_forked_one_does(tmp_path: Path) -> None:
    new, forked = (
        fresh("-m", "layoutrl.watch", "run=nowhere", cwd=tmp_path),
        layoutrl("watch", "run=nowhere", cwd=tmp_path),
    )
    assert new.returncode == forked.returncode == 1
    assert (new.stdout, new.stderr) == (forked.stdout, forked.stderr)
    assert len(new.stderr.splitlines()) == 1


def test_a_second_run_never_overwrites_the_first(tmp_path: Path) -> None:
    first, second = (trained(tmp_path, "room=study", "name=mine", *FEW) for _ in range(2))
    assert [first.name, second.name] == ["mine", "mine-2"]
    assert checkpoints(first)


def test_tensorboard_shows_what_its_page_says(bedroom_run: Path) -> None:
    board = EventAccumulator(str(bedroom_run))
    board.Reload()
    page = (PROJECT / "docs" / "tensorboard.md").read_text()
    documented = {tag for row in re.findall(r"^\| (`.*?) \|", page, re.MULTILINE) for tag in re.findall("`(.*?)`", row)}
    tags = board.Tags()
    first_and_last = {f"{part}/{k}" for part in ("train", "held_out") for k in (0, 3)}
    assert first_and_last <= documented
    assert set(tags["images"]) == {f"{part}/{k}" for part in ("train", "held_out") for k in range(2)}  # of two rooms
    assert set(tags["scalars"]) == documented - first_and_last
    (text,) = board.Tensors("config/text_summary")
    assert b"room:" in text.tensor_proto.string_val[0]
    charts = board.Tensors("custom_scalars__config__")[0].tensor_proto.string_val[0].decode("latin-1")
    assert "iou/held_out" in charts


def test_tensorboard_compares_runs_in_a_table(bedroom_run: Path) -> None:
    board = EventAccumulator(str(bedroom_run))
    board.Reload()
    content = board.PluginTagToContent("hparams")
    started = HParamsPluginData.FromString(content["_hparams_/session_start_info"]).session_start_info.hparams
    assert started["room.type"].string_value == "bedroom"
    assert started["method.discount"].number_value == 0.7
    assert started["method.steps"].string_value == "[0.32, 0.08, 0.02, 0.005]"
    metrics_shown = HParamsPluginData.FromString(content["_hparams_/experiment"]).experiment.metric_infos
    assert {"final/mean_iou", "final/share_090"} <= {metric.name.tag for metric in metrics_shown}
    agent = evaluation(bedroom_run)["rows"]["agent"]
    assert board.Scalars("final/mean_iou")[0].value == pytest.approx(agent["mean_iou"])


def test_evaluate_scores_a_run_again_and_stores_it(bedroom_run: Path, tmp_path: Path) -> None:
    done = layoutrl("evaluate", f"run={bedroom_run}", "starts=3", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "lattice ceiling" in done.stdout
    (file,) = bedroom_run.glob("evaluation-designer-rooms0-held_out-*-mask-3.json")
    stored = json.loads(file.read_text())
    assert len(stored["positions"]) == 24
    assert (stored["run"], stored["checkpoint"], stored["on_illegal"]) == (str(bedroom_run), "last", "mask")
    assert stored["updates"] == stored["config"]["method"]["updates"]["smoke"]


def test_an_evaluation_does_not_mark_a_run_as_finished(bedroom_run: Path, tmp_path: Path) -> None:
    shutil.copytree(bedroom_run, tmp_path / "run")
    (tmp_path / "run" / "evaluation.json").unlink()
    done = layoutrl("evaluate", "run=run", "out=run/evaluation.json", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == "error: out: a run with an evaluation.json is finished; expected another name\n"


def test_evaluate_finds_what_the_training_found_unless_another_seed_is_given(bedroom_run: Path, tmp_path: Path) -> None:
    found = evaluation(bedroom_run)
    for options, same in (([], True), (["seed=0"], False)):
        done = layoutrl("evaluate", f"run={bedroom_run}", "out=found.json", *options, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        again = json.loads((tmp_path / "found.json").read_text())
        (tmp_path / "found.json").unlink()
        assert all((again[name] == found[name]) == same for name in ("rows", "positions"))


def test_evaluate_scores_rooms_of_the_users_own(bedroom_run: Path, tmp_path: Path) -> None:
    known, *others = (
        design_rooms("bedroom", "train", seed=0, count=1).rooms + design_rooms("bedroom", "test", 7, 3).rooms
    )
    lines = [json.dumps(room_to_dict(room)) for room in (*others, known)]
    (tmp_path / "mine.jsonl").write_text("\n".join([lines[0], lines[1][:100], *lines[2:]]))
    done = layoutrl("evaluate", f"run={bedroom_run}", "data=json", "data.root=mine.jsonl", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "mine.jsonl:2" in done.stdout
    assert "left out 1 rooms that the agent was trained on" in done.stdout
    assert "2 rooms of json (all)" in done.stdout


def test_place_puts_what_has_no_center_where_the_agent_moves_it_and_nothing_else(
    bedroom_run: Path, tmp_path: Path
) -> None:
    documents = [room_to_dict(room) for room in design_rooms("bedroom", "test", 7, 4).rooms]
    beds = [document["target"] for document in documents]
    for document, bed in zip(documents[:3], beds, strict=False):
        del document["furniture"][bed]["center"]
    documents[1]["target"] = next(k for k in range(9) if k != beds[1])  # is left as it is
    documents.append(
        documents[0] | {"id": "too-small", "furniture": [{"category": "bed", "size": [9, 9]}], "target": 0}
    )
    (tmp_path / "mine.jsonl").write_text("\n".join(map(json.dumps, documents)))
    done = layoutrl("place", f"run={bedroom_run}", "rooms=mine.jsonl", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == "error: not everything is placed, as is said above\n"
    assert "too-small: 0 of 1 placed; the bed of 9 by 9 m is not placed: it fits into the room in no way" in done.stdout
    written = [json.loads(line) for line in (tmp_path / "mine-placed.jsonl").read_text().splitlines()]
    kept = load_config(bedroom_run, TrainConfig)
    method = kept.method
    network, _, categories = kept_agent(bedroom_run, kept, CPU).agent
    rooms = [replace(room_from_dict(d), target=bed) for d, bed in zip(written[:3], beds, strict=False)]
    simulator = Simulator(rooms, method.moves, Reward())  # whose starts are those in the rooms without an answer
    batch, index = BatchSimulator(simulator, CPU), torch.arange(3).repeat_interleave(STARTS_PER_FACING)
    drawn = np.stack([rng_of(room, [0, 0]).random(3) for room in rooms], 1).repeat(STARTS_PER_FACING, 1)
    starts = batch.starts_at(index, torch.as_tensor((np.tile(spread(0, STARTS_PER_FACING), 3) + drawn) % 1))
    observe = observation_of(method.observation, rooms, CPU, categories)
    went = greedy(network, method).rollout(batch, observe, index, starts.numpy())
    value = went.value[went.best, np.arange(len(index))].reshape(3, STARTS_PER_FACING)
    expected = went.final.reshape(3, STARTS_PER_FACING, 2)[np.arange(3), value.argmax(1)]
    assert np.allclose([room.moving.center for room in rooms], expected, atol=1e-4)
    for before, after, bed in zip(documents[:3], written, beds, strict=False):
        assert f"{after['id']}: 1 of 1 placed; " in done.stdout
        del after["furniture"][bed]["center"]
        for item in after["furniture"]:
            item.pop("faults", None)
        assert after == before
    assert written[3] == documents[3]
    other = layoutrl("place", f"run={bedroom_run}", "rooms=mine.jsonl", "item=desk", "out=other.jsonl", cwd=tmp_path)
    assert "item: the agent was trained to move a bed" in other.stderr
    again = layoutrl("place", f"run={bedroom_run}", "rooms=mine.jsonl", cwd=tmp_path)
    assert "mine-placed.jsonl is there already" in again.stderr


def test_shards_are_placed_side_by_side_as_on_a_cluster(tmp_path: Path) -> None:
    """By submitit, which starts jobs on Slurm, too."""
    documents = [room_to_dict(room) for room in design_rooms("balcony", "test", 7, 4).rooms]
    for document in documents[:2]:
        del document["furniture"][0]["center"]
    (tmp_path / "mine.jsonl").write_text("\n".join(map(json.dumps, documents)))
    given = ("by=agents", "rooms=mine.jsonl", "shard=0/2,1/2", "hydra/launcher=submitit_local")
    done = fresh("-m", "layoutrl", "place", "-m", *given, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for shard in range(2):
        text = (tmp_path / f"mine-placed-{shard}of2.jsonl").read_text()
        assert [json.loads(line)["id"] for line in text.splitlines()] == [d["id"] for d in documents[shard::2]]


def test_one_agent_learns_to_place_every_item_of_the_type(tmp_path: Path) -> None:
    result = evaluation(trained(tmp_path, "room=bathroom", "room.item=all", FEW_PICTURES))
    assert result["groups"] == 8
    assert result["rooms"] == len(result["positions"]) > 16
    assert {"toilet", "vanity"} <= result["items"].keys()


def test_evaluate_scores_designed_rooms_of_another_seed(bedroom_run: Path, tmp_path: Path) -> None:
    few = ("data=designer", "data.seed=1", "data.train_rooms=4", "data.test_rooms=3")
    done = layoutrl("evaluate", f"run={bedroom_run}", *few, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "3 rooms of designer (held_out)" in done.stdout
    assert len([*bedroom_run.glob("evaluation-designer-rooms1-held_out-*-mask-1.json")]) == 1


def test_evaluate_takes_the_runs_own_data_but_for_what_is_given(bedroom_run: Path, tmp_path: Path) -> None:
    done = layoutrl("evaluate", f"run={bedroom_run}", "data.test_rooms=3", "starts=2", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "3 rooms of designer (held_out)" in done.stdout
    given = ("data=designer", "data.test_rooms=3", "part=training", "starts=2")
    done = layoutrl("evaluate", f"run={bedroom_run}", *given, cwd=tmp_path)
    assert "32 rooms of designer (training)" in done.stdout  # as many as it was trained on
    done = layoutrl("evaluate", f"run={bedroom_run}", "data.train_rooms=5", "part=training", cwd=tmp_path)
    assert "5 rooms of designer (training)" in done.stdout


def test_watch_shows_the_agent_move(bedroom_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In this process, with fewer pictures: they take longest."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("layoutrl.watch.FRAMES_A_MOVE", 1)

    def watch(out: str) -> None:
        monkeypatch.setattr("sys.argv", ["layoutrl.watch", f"run={bedroom_run}", "rooms=4", "width=150", f"out={out}"])
        import_module("layoutrl.watch").main()

    watch("films/mine")
    for suffix in ("gif", "webp"):
        with Image.open(tmp_path / "films" / f"mine.{suffix}") as film:
            assert film.size[0] == 150  # three rooms side by side, and one below
            assert film.n_frames > 2
            assert film.convert("RGB").getpixel((0, 0)) == (255, 255, 255)
            film.seek(film.n_frames - 1)
            film.load()
            assert film.info["duration"] > 1000  # time to read the IoU
    watch("films/again")
    said = r"^error: out: films/again\.gif is there already; expected the name of a new \.gif file"
    with pytest.raises(SystemExit, match=said):
        watch("films/again.gif")
    assert (tmp_path / "films" / "again.gif").read_bytes() == (tmp_path / "films" / "mine.gif").read_bytes()


def test_the_gallery_draws_rooms_as_png_and_svg(tmp_path: Path) -> None:
    done = layoutrl("gallery", "room=balcony", "rooms=7", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    png, svg = (tmp_path / "gallery" / f"balcony-designer-seed0.{suffix}" for suffix in ("png", "svg"))
    with Image.open(png) as picture:
        assert picture.size == (1728, 576)  # two rows of six
    names = re.findall(r"balcony-\w+-train0-(\d)", svg.read_text())
    assert sorted(set(names)) == list("0123456")
    assert "laundry" in svg.read_text()
    first = svg.read_bytes()
    layoutrl("gallery", "room=balcony", "rooms=7", cwd=tmp_path)
    assert svg.read_bytes() == first


def test_the_gallery_draws_all_rooms_of_a_file(tmp_path: Path) -> None:
    rooms = design_rooms("bedroom", "test", 7, 6).rooms  # in whichever fold
    (tmp_path / "mine.jsonl").write_text("\n".join(json.dumps(room_to_dict(room)) for room in rooms))
    done = layoutrl("gallery", "data=json", "data.root=mine.jsonl", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    svg = (tmp_path / "gallery" / "bedroom-json-mine.svg").read_text()
    assert all(room.id in svg for room in rooms)


def test_the_gallery_draws_all_types(tmp_path: Path) -> None:
    done = layoutrl("gallery", "all_types=true", "rooms=8", "out=sheets", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "sheets" / "all_types-designer-seed0.svg").read_text()
    assert all(f"{room}-" in text for room in ROOMS)


@pytest.mark.parametrize(
    ("command", "arguments", "words"),
    [
        ("train", ["room=bedrom"], ["bedrom", "bedroom", "tatami"]),
        ("train", ["data=floorplan"], ["floorplan", "designer_rooms"]),
        ("train", ["method=papr"], ["papr", "geometric"]),
        ("train", ["budget=smok"], ["smok", "default"]),
        ("train", ["sed=1"], ["sed"]),
        ("train", ["seed=one"], ["seed", "a whole number"]),
        ("train", ["fold=5"], ["fold", "0 to 4"]),
        ("train", ["room.item=sofa", "budget=smoke"], ["room.item", "sofa", "bed", "wardrobe"]),
        ("train", ["data=floorplans", "data.labels=snap"], ["data.labels", "snapped", "raw"]),
        ("train", ["room=tatami", "data=floorplans"], ["tatami", "bathroom", "kitchen"]),
        ("train", ["room=bathroom", "data=floorplans", "data.root=nowhere"], ["nowhere", "data.root"]),
        ("train", ["data=json", "data.root=nowhere.jsonl"], ["nowhere.jsonl"]),
        ("train", ["device=cuda:99", "data=json", "data.root=nowhere.jsonl"], ["device", "cuda:99"]),  # before rooms
        ("planit.train", ["device=cuda:99", "data=json", "data.root=nowhere.jsonl"], ["device", "cuda:99"]),
        ("train", ["runs=/dev/null", "data=json", "data.root=nowhere.jsonl"], ["runs: ", "/dev/null"]),
        ("train", ["runs=", "data=json", "data.root=nowhere.jsonl"], ["runs: expected the name of a folder; it is"]),
        ("train", ["name=" + 251 * "x", "data=json", "data.root=nowhere.jsonl"], ["name: expected at most 250 bytes"]),
        ("train", ["name=" + 250 * "x", "data=json", "data.root=nowhere.jsonl"], ["nowhere.jsonl"]),
        ("planit.train", ["runs=/dev/null", "data=json", "data.root=nowhere.jsonl"], ["runs: ", "/dev/null"]),
        ("train", ["method.steps=[0.3,0.2]"], ["method.steps", "multiples"]),
        ("train", ["method.steps=[]"], ["method.steps", "finite lengths above zero"]),
        ("train", ["method.steps=[inf]"], ["method.steps", "finite lengths above zero"]),
        ("train", ["method.learning_rate=inf"], ["method.learning_rate", "finite"]),
        ("planit.train", ["method.learning_rate=inf"], ["method.learning_rate", "finite"]),
        ("train", ["reward.theta1=nan"], ["reward.theta1", "a finite number"]),
        ("train", ["reward=usable"], ["reward: expected none with scope=item", "reward=usable", "got a fourth term"]),
        ("train", ["reward.inside=foo"], ["reward.inside", "share or iou"]),
        ("train", ["reward.faces_away=0.1"], ["reward.faces_away", "0.5 with scope=item", "got 0.1"]),
        ("train", ["method.own_share=0"], ["method.own_share", "0.5 with scope=item", "got 0"]),
        ("train", ["method.discount_start=0.4"], ["method.discount_start", "0.5 without method.every_move"]),
        ("train", ["fold=1"], ["fold: expected 0, as the designer makes rooms of their own", "got 1"]),
        ("planit.train", ["fold=1"], ["fold: expected 0, as the designer makes rooms of their own", "got 1"]),
        ("train", ["fold=4", "data=json", "data.root=nowhere.jsonl"], ["nowhere.jsonl"]),
        ("train", ["method=null"], ["method: expected the name of one", "got null"]),
        ("evaluate", ["run=nowhere", "data=null"], ["data: expected the name of one", "got null"]),
        ("train", ["--resolve"], ["--resolve: it is of --cfg"]),
        ("train", ["--experimental-rerun=nowhere"], ["--experimental-rerun: Hydra's"]),
        ("train", ["method.name=../elsewhere"], ["method.name", "the name of a folder, without /"]),
        ("train", ["method.max_moves=100000000000000000000"], ["method.max_moves", "at most 2147483647"]),
        *(
            ("train", [f"method.{name}=100000000000000000000"], [f"method.{name.split('.')[0]}", "at most 2147483647"])
            for name in ("replay_capacity", "warmup_moves", "climbs", "updates.smoke")
        ),
        ("train", ["data=json", "data.labels=raw"], ["data.labels", "none, as it is of data=floorplans alone"]),
        ("train", ["data=floorplans", "data.unit=cm"], ["data.unit", "none, as it is of data=json alone; got cm"]),
        ("train", ["data.strict=true"], ["data.strict", "as it is of data=json alone"]),
        ("train", ["data=json", "data.categories=mine.yaml"], ["data.categories", "data=sweethome3d or procthor or"]),
        ("planit.train", ["data.unit=cm"], ["data.unit", "as it is of data=json alone"]),
        ("gallery", ["data.unit=cm"], ["data.unit", "as it is of data=json alone"]),
        ("evaluate", ["run=nowhere", "data=designer", "data.unit=cm"], ["data.unit", "as it is of data=json alone"]),
        ("planit.train", ["method.name=../elsewhere"], ["method.name", "the name of a folder, without /"]),
        ("train", [f"~method.updates.{budget}" for budget in BUDGETS], ["method.updates", "1 or more each"]),
        ("planit.train", [f"~method.updates.{budget}" for budget in BUDGETS[1:]], ["method.updates", "1 or more each"]),
        ("train", ["method.steps=[.64,.32,.16,.08,.04,.02,.01]"], ["method.steps", "at most 6 lengths"]),
        ("train", ["device=meta"], ["device", "meta"]),
        ("train", ["method.batch=0"], ["method.batch", "1 or more"]),
        ("train", ["method.climbs=-1"], ["method.climbs", "0 or more"]),
        ("train", ["method.snap=-0.1"], ["method.snap", "0 or more metres"]),
        ("train", ["method=paper", "method.snap=0.01"], ["method.snap", "0 with method.observation=image"]),
        (
            "train",
            ["method.every_move=true", "method.climbs=0", "method.slide=false"],
            ["method.snap", "0 with method.every_move"],
        ),
        (
            "train",
            ["method=paper_every_move", "method.on_illegal=stop"],
            ["method.on_illegal with every_move", "expected one of mask; got stop"],
        ),
        ("train", ["data.train_rooms=0"], ["data.train_rooms", "1 or more"]),
        ("train", ["data.disturbed=1.5"], ["data.disturbed", "0 to 1"]),
        ("train", ["budget.reports=0"], ["budget.reports", "1 or more"]),
        ("train", ["budget.name=foo"], ["budget.name", "smoke"]),
        ("train", ["resume=nowhere"], ["resume: nowhere", "the folder of a training run"]),
        ("planit.train", ["resume=nowhere"], ["resume: nowhere", "the folder of a training run"]),
        ("train", ["resume="], ["resume: expected the folder of a run"]),
        ("gallery", ["room=bedrom"], ["bedrom", "tatami"]),
        ("gallery", ["data.seed=-1"], ["data.seed", "0 or more"]),
        ("train", ["data.seed=null", "budget=smoke"], ["data.seed", "null"]),
        ("evaluate", ["run=nowhere", "data=designer", "data.test_rooms=0"], ["data.test_rooms", "1 or more"]),
        ("gallery", ["rooms=0"], ["rooms", "1 or more"]),
        ("gallery", ["out=/dev/null/here"], ["out", "/dev/null/here"]),
        ("evaluate", ["run=nowhere"], ["nowhere"]),
        ("place", ["run=nowhere", "rooms=mine.jsonl"], ["mine.jsonl", "no such file"]),
        ("place", ["run=nowhere"], ["rooms"]),
        ("watch", ["run=nowhere"], ["nowhere"]),
        ("evaluate", ["run=nowhere", "checkpoint=first"], ["checkpoint", "last, best"]),
        ("watch", ["run=nowhere", "rooms=0"], ["rooms", "1 or more"]),
        ("watch", ["run=nowhere", "width=100000"], ["width", "100 to 1500"]),
        ("watch", ["run=nowhere", "rooms=19"], ["rooms: expected at most 18 with width=720"]),
        ("watch", ["run=nowhere", "rooms=18"], ["nowhere"]),
        ("evaluate", ["run=nowhere", "data=floorplans", "data.labels=snap"], ["data.labels: expected one of snapped"]),
        ("gallery", ["data=floorplans", "data.labels=snap"], ["data.labels: expected one of snapped"]),
        ("train", ["data.source=bogus", "runs=/dev/null"], ["data.source: expected one of designer, floorplans"]),
        ("evaluate", ["run=nowhere", "data=designer", "data.source=bogus"], ["data.source: expected one of designer"]),
        ("evaluate", [], ["run"]),
        ("evaluate", ["run=nowhere", "data.root=elsewhere"], ["nowhere"]),
    ],
)
def test_what_the_user_got_wrong_is_answered_without_a_traceback(
    command: str, arguments: list[str], words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In this process: what Python itself makes of an exit is tried by the test of a new interpreter."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", [f"layoutrl.{command}", *arguments])
    with pytest.raises(SystemExit) as ended:
        import_module(f"layoutrl.{command}").main()
    said = str(ended.value.code)
    assert said.startswith("error: ")
    assert len(said.splitlines()) == 1
    assert all(word in said for word in words), said
    assert not list(tmp_path.iterdir())


def test_a_damaged_checkpoint_is_answered_without_a_traceback(bedroom_run: Path, tmp_path: Path) -> None:
    shutil.copytree(bedroom_run, tmp_path, dirs_exist_ok=True)
    for checkpoint in checkpoints(tmp_path):
        checkpoint.file.write_bytes(checkpoint.file.read_bytes()[:2000])
    done = layoutrl("evaluate", f"run={tmp_path}", cwd=tmp_path)
    assert done.returncode != 0
    assert "Traceback" not in done.stderr
    assert "no whole checkpoint" in done.stderr
