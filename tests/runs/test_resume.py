"""A run goes on as if it had never stopped, however it was stopped, and what was saved of it stays whole."""

from __future__ import annotations

import csv
import errno
import json
import os
import random
import re
import shlex
import shutil
import signal
import sys
import time
from dataclasses import replace
from functools import cache
from multiprocessing.connection import Connection
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from omegaconf import OmegaConf
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from layoutrl import InputError
from layoutrl.agents.training import Training
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.documents import room_to_dict
from layoutrl.rooms.sources.parts import Data
from layoutrl.runs import resume
from layoutrl.runs.checkpoints import checkpoints, load_checkpoint, save_checkpoint
from layoutrl.runs.commands import Stopped
from layoutrl.runs.config import AS_IN_THE_RUN, RunConfig, TrainConfig, composed, narrowed
from layoutrl.runs.files import LOCK, locked
from layoutrl.runs.resume import resume_run
from layoutrl.runs.trained import trained_run
from layoutrl.train import run
from tests.commands import SERVER
from tests.commands import layoutrl as command
from tests.rooms.sources.test_sweethome3d import home_file

resource = pytest.importorskip(
    "resource", reason="lives are begun by a fork server and ended by signals, as POSIX has it"
)
CPU = torch.device("cpu")
UPDATES = 120
SHORT = (
    "budget=smoke", f"method.updates.smoke={UPDATES}", "method.batch=16", "method.episodes=8",
    "method.warmup_moves=100", "method.replay_capacity=500", "method.evaluation_moves=4", "budget.reports=12",
    "budget.evaluations=4", "budget.evaluation_rooms=1", "device=cpu",
)  # fmt: skip


@pytest.fixture(scope="module")
def rooms(tmp_path_factory) -> Path:
    file = tmp_path_factory.mktemp("rooms") / "rooms.jsonl"
    designed = design_rooms("tatami", "train", 0, 12).rooms
    file.write_text("\n".join(json.dumps(room_to_dict(room)) for room in designed))
    return file


@cache
def configured(rooms: Path, folder: Path, *overrides: str) -> TrainConfig:
    places = ("room=tatami", "data=json", f"data.root={rooms}", f"runs={folder}", "name=one")
    return narrowed(composed("train", *places, *SHORT, *overrides), TrainConfig)


@pytest.fixture(scope="module")
def whole(rooms, tmp_path_factory) -> Path:
    """A run that nothing stopped."""
    torch.set_num_threads(1)
    return run(configured(rooms, tmp_path_factory.mktemp("whole")))


def outcome(folder: Path) -> dict[str, Any]:
    """All that a run left, but for times and for where it lies."""
    state = load_checkpoint(folder, CPU)
    with (folder / "metrics.csv").open() as file:
        metrics = [{k: v for k, v in row.items() if not k.startswith("seconds")} for row in csv.DictReader(file)]
    evaluation = json.loads((folder / "evaluation.json").read_text())
    times = ("training_seconds", "ms_a_start", "machine")
    return {
        "network": {name: value.tolist() for name, value in state["training"]["agent"]["network"].items()},
        "replay": [column.tolist() for column in state["training"]["replay"]["columns"]],
        "metrics": metrics,
        "evaluation": {name: value for name, value in evaluation.items() if name not in times},
        "checkpoints": [checkpoint.updates for checkpoint in checkpoints(folder)],
    }


def life(config: TrainConfig, folder: Path) -> None:
    """One life of a run, in a process of its own: it begins, or goes on."""
    torch.set_num_threads(1)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # which what begins in the background of a shell lacks
    begun = resume.find_begun_run(config)
    try:
        resume_run(begun, run, TrainConfig) if begun else run(config)
    except Stopped as stopped:
        (folder / "said.txt").write_text(str(stopped))


def lived(rooms: Path, folder: Path, seconds: float = 300, number: int = signal.SIGKILL) -> int:
    """The exit status of a life that is ended by a signal after some time, or by itself.

    What can be answered (not SIGKILL) is sent only when a training has begun to save.
    """
    begun = folder / "tatami" / "one"
    saved = checkpoints(begun)[:1]
    process = SERVER.Process(target=life, args=(configured(rooms, folder), folder))
    process.start()
    while number != signal.SIGKILL and process.is_alive() and checkpoints(begun)[:1] == saved:
        time.sleep(0.01)
    process.join(seconds)
    if process.is_alive():
        os.kill(process.pid, number)
        process.join(60)
    assert process.exitcode is not None
    return process.exitcode


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_that_is_stopped_and_goes_on_is_the_run_that_never_stopped(number, rooms, whole, tmp_path):
    begun = tmp_path / "tatami" / "one"
    for _ in range(3 if number == signal.SIGINT else 1):
        assert lived(rooms, tmp_path, 0.02, number) == 0
        stopped_at = checkpoints(begun)[0].updates
        assert f"after {stopped_at} of {UPDATES} updates; " in (said := (tmp_path / "said.txt").read_text())
        assert said.endswith(f"go on with: {resume.interpreter()} -m layoutrl.train resume={begun}")
    assert not (begun / "evaluation.json").exists()
    seconds = load_checkpoint(begun, CPU)["seconds"]  # rivals are trained as long as the agent was in all its lives
    assert lived(rooms, tmp_path) == 0
    assert json.loads((begun / "evaluation.json").read_text())["training_seconds"] > seconds
    expected = outcome(whole)
    assert outcome(begun) | {"checkpoints": expected["checkpoints"]} == expected


def killed(rooms: Path, folder: Path, reports: int, seconds: float) -> None:
    """A life that is killed some time after so many reports: on a busy machine, too, it came as far."""
    process = SERVER.Process(target=life, args=(configured(rooms, folder), folder))
    before, seen = reports_of(folder), 0
    process.start()
    while process.is_alive() and seen < reports:
        now = reports_of(folder)
        seen, before = seen + max(0, now - before), now  # as it goes on, those since its checkpoint are taken back
        time.sleep(0.01)
    process.join(seconds)
    process.kill()
    process.join()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_stops_a_training_once_and_not_where_it_is_ignored(number):
    training = SimpleNamespace(stopping=False)
    before = signal.signal(number, signal.SIG_IGN)  # as nohup has it
    try:
        with resume.stopped_by_signals(training):
            signal.raise_signal(number)
        assert not training.stopping
        heard: list[int] = []
        signal.signal(number, lambda number, _: heard.append(number))
        with resume.stopped_by_signals(training):
            signal.raise_signal(number)
            assert (training.stopping, heard) == (True, [])
            signal.raise_signal(number)
        assert heard == [number]
    finally:
        signal.signal(number, before)


def test_who_stops_a_training_is_told_how_it_goes_on_and_it_saves_though_the_terminal_is_gone(capfd, monkeypatch):
    training = SimpleNamespace(stopping=False)
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    try:
        with resume.stopped_by_signals(training):
            signal.raise_signal(signal.SIGHUP)
        assert "stops after this update, and saves; the same signal again: stops at once" in capfd.readouterr().err

        def gone(*_):
            raise OSError(errno.EIO, "Input/output error")

        training.stopping = False
        with monkeypatch.context() as patch, resume.stopped_by_signals(training):
            patch.setattr(os, "write", gone)
            signal.raise_signal(signal.SIGHUP)
        assert training.stopping
    finally:
        signal.signal(signal.SIGHUP, before)


def reports_of(folder: Path) -> int:
    return sum(file.read_text().count("\n") for file in folder.glob("tatami/*/metrics.csv"))


def test_after_twenty_kills_a_run_is_the_run_that_was_never_killed(rooms, whole, tmp_path):
    dice = random.Random(0)
    for _ in range(20):
        reports = dice.choice([0, 1, 3, 5])  # a checkpoint comes after every third
        killed(rooms, tmp_path, reports, dice.uniform(0, 0.05 if reports else 0.5))
        for finished in tmp_path.glob("tatami/*/evaluation.json"):  # it was faster than twenty kills
            finished.unlink()  # once more from the last checkpoints
    # Not "one", if that was killed before its config.yaml was there.
    begun = resume.find_begun_run(configured(rooms, tmp_path))
    assert begun
    assert checkpoints(begun)
    assert lived(rooms, tmp_path) == 0
    assert outcome(begun) == outcome(whole)


def test_a_run_that_was_killed_as_its_folder_was_made_begins_in_another(rooms, whole, tmp_path):
    (tmp_path / "tatami" / "one").mkdir(parents=True)
    assert lived(rooms, tmp_path) == 0
    assert outcome(tmp_path / "tatami" / "one-2") == outcome(whole)


def test_a_full_disk_as_a_run_begins_is_answered_and_leaves_nothing_behind(rooms, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("layoutrl.runs.files.os.fsync", full)
    with pytest.raises(InputError, match=r"cannot write to .*one \(No space left on device\); expected a disk"):
        run(configured(rooms, tmp_path))
    assert not list(tmp_path.glob("tatami/*"))


def test_what_is_finished_is_not_begun_again(rooms, whole, capsys):
    assert resume_run(whole, run, TrainConfig) == whole
    assert f"{whole} is finished" in capsys.readouterr().out


@pytest.mark.parametrize("told", [True, False])
def test_a_run_goes_on_with_the_threads_that_it_began_with(told, rooms, whole, tmp_path, monkeypatch):
    folder = copy_of(whole, tmp_path)
    state, seen = load_checkpoint(folder, CPU), list[int]()
    assert state.pop("threads") == 1
    save_checkpoint(folder, state | ({"threads": 2} if told else {}), UPDATES)
    monkeypatch.setattr("layoutrl.runs.monitor.record_result", lambda *_: seen.append(torch.get_num_threads()))
    resume_run(folder, run, TrainConfig)
    assert seen == [2 if told else 1]
    assert torch.get_num_threads() == 1


def test_the_command_that_goes_on_is_as_a_shell_takes_it(rooms, tmp_path):
    config, folder = configured(rooms, tmp_path), tmp_path / "my runs" / "one"
    folder.mkdir(parents=True)
    (folder / "config.yaml").write_text(OmegaConf.to_yaml(OmegaConf.structured(config)))
    begins = [resume.interpreter(), "-m", "layoutrl.train", f"resume={folder}"]
    assert shlex.split(resume.going_on(folder, config)) == begins
    elsewhere = replace(config, data=replace(config.data, root="my rooms.jsonl"), device="cuda:1")
    said = [*begins, f"data.root={Path.cwd() / 'my rooms.jsonl'}", "device=cuda:1"]
    assert shlex.split(resume.going_on(folder, elsewhere)) == said


@pytest.mark.parametrize(
    ("found", "here", "called"),
    [
        ("/home/ada/own/.venv/bin/python", "/", "python"),
        ("/usr/bin/python", "/home/ada/own", ".venv/bin/python"),
        (None, "/home/ada/own/runs", "/home/ada/own/.venv/bin/python"),
    ],
)
def test_the_interpreter_is_called_as_a_shell_finds_it(found, here, called, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/home/ada/own/.venv/bin/python")
    monkeypatch.setattr(shutil, "which", lambda _: found)
    monkeypatch.setattr(Path, "cwd", lambda: Path(here))
    assert resume.interpreter() == called


def test_a_run_whose_rooms_are_elsewhere_now_goes_on_there_if_they_are_the_same(rooms, whole, tmp_path):
    folder, there = copy_of(whole, tmp_path / "a run"), tmp_path / "my rooms.jsonl"
    config = (folder / "config.yaml").read_text()
    (folder / "config.yaml").write_text(config.replace(str(rooms), str(tmp_path / "gone.jsonl")))
    done = command("train", f"resume={folder}", cwd=tmp_path)
    assert f"data.root: {folder} has its rooms of {tmp_path}/gone.jsonl, which is not there; expected" in done.stderr
    there.write_text("\n".join(rooms.read_text().splitlines()[1:]))
    arguments = ("train", f"resume={folder}", f"data.root={there.name}", "device=cpu")
    done = command(*arguments, cwd=tmp_path)
    assert f"the checkpoint of {folder} is of other rooms; expected those that it began with" in done.stderr
    there.write_text(rooms.read_text())
    done = command(*arguments, cwd=tmp_path)
    assert (done.returncode, done.stderr.count("error")) == (0, 0), done.stderr
    assert outcome(folder) == outcome(whole)


def test_a_run_that_was_killed_before_its_first_checkpoint_begins_anew(rooms, whole, tmp_path):
    folder = copy_of(whole, tmp_path)
    shutil.rmtree(folder / "checkpoints")
    resume_run(folder, run, TrainConfig)
    assert outcome(folder) == outcome(whole)
    steps, expected = ([event.step for event in reloaded(f).Scalars("loss")] for f in (folder, whole))
    assert steps == expected


def copy_of(run_folder: Path, tmp_path: Path) -> Path:
    """The run as it was before it was evaluated."""
    folder = Path(shutil.copytree(run_folder, tmp_path / "tatami" / "one"))
    (folder / "evaluation.json").unlink()
    return folder


@pytest.mark.parametrize("damage", [lambda b: b[:-100], lambda b: b"", lambda b: b[:500] + b"x" + b[501:]])
def test_the_checkpoint_before_a_damaged_one_is_taken(damage, rooms, whole, tmp_path, capsys):
    folder = copy_of(whole, tmp_path)
    last = checkpoints(folder)[0]
    last.file.write_bytes(damage(last.file.read_bytes()))
    resume_run(folder, run, TrainConfig)
    said, warned = capsys.readouterr()
    assert f"{last.file} is damaged (its hash is another); {checkpoints(whole)[1].file.name} is taken instead" in warned
    assert f"going on after {checkpoints(whole)[1].updates} updates" in said
    assert outcome(folder) == outcome(whole)


@pytest.mark.parametrize("mark", ["", "{", "[]", "null", '{"updates": 1}', '{"updates": "x", "iou": 0, "sha256": ""}'])
def test_a_checkpoint_without_a_whole_mark_is_none(mark, whole, tmp_path, capsys):
    folder = copy_of(whole, tmp_path)
    last, before, *_ = checkpoints(folder)
    last.file.with_suffix(".json").write_text(mark)
    assert checkpoints(folder)[0] == before
    assert "its checkpoint is left out" in capsys.readouterr().err


def test_a_run_whose_marks_are_all_damaged_is_not_begun_anew(whole, tmp_path):
    folder = copy_of(whole, tmp_path)
    for checkpoint in checkpoints(folder):
        checkpoint.file.with_suffix(".json").write_text("")
    with pytest.raises(InputError, match="has no mark that can be read; expected those of a training run"):
        resume_run(folder, run, TrainConfig)


def test_who_stops_a_training_at_its_end_need_not_wait_for_its_evaluation(rooms, whole, tmp_path, monkeypatch):
    save = resume.Session.save

    def stopped(session: resume.Session, iou: float | None) -> None:
        save(session, iou)
        session._training.stopping = session._training.updates == UPDATES

    folder = tmp_path / "tatami" / "one"
    with monkeypatch.context() as patch:
        patch.setattr(resume.Session, "save", stopped)
        with pytest.raises(Stopped, match=f"stopped before its evaluation; go on with: .*resume={folder}"):
            run(configured(rooms, tmp_path))
    assert not (folder / "evaluation.json").exists()
    resume_run(folder, run, TrainConfig)
    assert outcome(folder) == outcome(whole)


def test_a_sweep_that_is_repeated_goes_on_where_it_is_told_now(rooms, whole, tmp_path):
    folder, seen = copy_of(whole, tmp_path), []

    def runs(config: TrainConfig, found: Path | None) -> Path:
        seen.append((config.device, found))
        return folder

    resume.run_in_sweep(replace(configured(rooms, tmp_path), device="cuda:1"), runs)
    assert seen == [("cuda:1", folder)]


def test_where_no_checkpoint_is_whole_it_is_said(whole, tmp_path):
    folder = copy_of(whole, tmp_path)
    for checkpoint in checkpoints(folder):
        checkpoint.file.write_bytes(b"")
    with pytest.raises(InputError, match="has no whole checkpoint"):
        resume_run(folder, run, TrainConfig)


def test_a_checkpoint_of_other_settings_rooms_content_or_format_is_refused_with_the_difference(rooms, whole, tmp_path):
    folder = copy_of(whole, tmp_path)
    config = (folder / "config.yaml").read_text()
    (folder / "config.yaml").write_text(config.replace("batch: 16", "batch: 32").replace("theta2: -100", "theta2: -50"))
    with pytest.raises(InputError, match=r"of another method\.batch, reward\.theta2; expected the same"):
        resume_run(folder, run, TrainConfig)
    fewer = tmp_path / "fewer.jsonl"
    fewer.write_text("\n".join(rooms.read_text().splitlines()[1:]))
    (folder / "config.yaml").write_text(config.replace(str(rooms), str(fewer)))
    with pytest.raises(InputError, match="of other rooms"):
        resume_run(folder, run, TrainConfig)
    (folder / "config.yaml").write_text(config)
    state = load_checkpoint(folder, CPU)
    save_checkpoint(folder, state | {"device": "cuda"}, UPDATES)
    with pytest.raises(InputError, match="is of cuda; expected to go on there, got cpu"):
        resume_run(folder, run, TrainConfig)
    save_checkpoint(folder, state | {"categories": [*state["categories"], "piano"]}, UPDATES)
    with pytest.raises(InputError, match="has other categories; expected the version of layoutrl that began the run"):
        resume_run(folder, run, TrainConfig)
    for lacking, said in (("device", "is of a device that it does not tell"), ("categories", "has other categories")):
        save_checkpoint(folder, {name: value for name, value in state.items() if name != lacking}, UPDATES)
        with pytest.raises(InputError, match=said):
            resume_run(folder, run, TrainConfig)
    save_checkpoint(folder, state | {"training": state["training"] | {"agent": {}}}, UPDATES)
    with pytest.raises(InputError, match=r"the checkpoint of .* does not fit \(KeyError"):
        resume_run(folder, run, TrainConfig)
    save_checkpoint(folder, state | {"format": 3}, UPDATES)
    with pytest.raises(InputError, match="is of format 3"):
        resume_run(folder, run, TrainConfig)


def holding(file: Path, ends: Connection) -> None:
    """A life that holds a lock until it is told to let go."""
    with locked(file, wait=False):
        ends.send("held")
        ends.recv()


def test_no_two_processes_train_in_one_folder(whole, tmp_path, monkeypatch):
    folder = copy_of(whole, tmp_path)
    here, there = SERVER.Pipe()
    other = SERVER.Process(target=holding, args=(folder / LOCK, there))
    other.start()
    assert here.recv() == "held"
    with monkeypatch.context() as patch:
        patch.setattr("layoutrl.train.parts_of", None)  # it is said before rooms are made
        with pytest.raises(InputError, match="is in use by another process"):
            resume_run(folder, run, TrainConfig)
    here.send("let go")
    other.join()
    resume_run(folder, run, TrainConfig)


def grown_to_the_limit(config: TrainConfig, folder: Path, limit: int, out: Connection) -> None:
    """A life in which no file may have more bytes."""
    for stream in (1, 2):
        os.dup2(out.fileno(), stream)  # a pipe has no limit
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    try:
        life(config, folder)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)


def limited(rooms: Path, folder: Path, limit: int) -> str:
    """The line that a life ends with in which no file may have more bytes: the only one of errors, as is checked."""
    said, out = SERVER.Pipe(duplex=False)
    process = SERVER.Process(target=grown_to_the_limit, args=(configured(rooms, folder), folder, limit, out))
    process.start()
    out.close()
    with open(said.fileno(), closefd=False) as stream:
        *before, last = stream.read().splitlines()
    process.join(60)
    assert process.exitcode == 0
    assert not any("Traceback" in line or "Exception" in line for line in before), before
    assert not list(folder.rglob("*.partial"))
    return last


def test_a_run_that_meets_a_full_disk_says_so_in_a_line_and_goes_on_later(rooms, whole, tmp_path):
    assert lived(rooms, tmp_path, 0.1, signal.SIGTERM) == 0
    begun = tmp_path / "tatami" / "one"
    saved = checkpoints(begun)[0].updates
    size = checkpoints(begun)[0].file.stat().st_size
    said = limited(rooms, tmp_path, size // 2)
    assert f"(File too large); that of {saved} updates is whole" in said
    assert checkpoints(begun)[0].updates == saved
    assert lived(rooms, tmp_path) == 0
    assert outcome(begun)["network"] == outcome(whole)["network"]


@pytest.mark.parametrize("limit", [10, 2_000, 5_000])  # too little for config.yaml, for TensorBoard, for its pictures
def test_a_disk_that_is_full_before_the_first_checkpoint_is_answered_in_a_line(limit, rooms, tmp_path):
    said = limited(rooms, tmp_path, limit)
    assert re.match(r"error: .* cannot write to .*tatami/one \(File too large\)", said)
    assert "checkpoint" not in said
    begins = f"a disk to write to, where it begins anew, as nothing is saved yet: {resume.interpreter()} -m "
    assert limit == 10 or begins in said


def test_a_disk_that_is_full_as_a_run_goes_on_is_answered_in_a_line(rooms, whole, tmp_path):
    folder = copy_of(whole, tmp_path)
    last = checkpoints(folder)[0]
    last.file.with_suffix(".json").unlink()
    kept, table = checkpoints(folder), (folder / "metrics.csv").read_text()
    said = limited(rooms, tmp_path, 10)
    assert f"cannot write to {folder} (File too large)" in said
    assert f"to write to, where the last checkpoint goes on: {resume.interpreter()} -m layoutrl.train resume=" in said
    assert checkpoints(folder) == kept
    assert (folder / "metrics.csv").read_text() == table


def test_what_cannot_be_shown_of_a_run_is_answered_in_a_line(rooms, tmp_path, monkeypatch):
    def full(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("layoutrl.runs.monitor.image", full)
    with pytest.raises(InputError, match=r"cannot write to .* \(No space left on device\) after 30 updates"):
        run(configured(rooms, tmp_path))


def spoilt(monkeypatch: pytest.MonkeyPatch, *, stops: bool) -> None:
    """Let values be no numbers between two reports, after the checkpoint of 30 updates."""
    learn = Training._learn

    def spoilt_after_35(training: Training) -> None:
        learn(training)
        if training.updates == 35:
            next(training.dqn.network.parameters()).data.fill_(torch.nan)
            training.stopping = stops

    monkeypatch.setattr(Training, "_learn", spoilt_after_35)


ANOTHER = r"begin another run with a lower method\.learning_rate$"


def test_a_loss_that_is_no_number_ends_the_run_and_is_never_saved(rooms, tmp_path, monkeypatch):
    spoilt(monkeypatch, stops=False)
    with pytest.raises(InputError, match=rf"the loss is nan after 40 updates; .*{ANOTHER}"):
        run(configured(rooms, tmp_path))
    assert [checkpoint.updates for checkpoint in checkpoints(tmp_path / "tatami" / "one")] == [30]


def test_a_stop_does_not_save_what_is_no_number(rooms, tmp_path, monkeypatch):
    spoilt(monkeypatch, stops=True)
    with pytest.raises(InputError, match=rf"a value is no number after 35 updates, which are not saved; {ANOTHER}"):
        run(configured(rooms, tmp_path))
    assert [checkpoint.updates for checkpoint in checkpoints(tmp_path / "tatami" / "one")] == [30]


def test_tensorboard_and_the_table_hold_each_update_once(rooms, whole, tmp_path):
    begun = tmp_path / "tatami" / "one"
    for _ in range(2):
        lived(rooms, tmp_path, 0.1, signal.SIGTERM)
    lived(rooms, tmp_path)
    for curve in ("loss", "iou/train"):
        steps, expected = ([event.step for event in reloaded(folder).Scalars(curve)] for folder in (begun, whole))
        assert steps == expected


def reloaded(folder: Path) -> EventAccumulator:
    board = EventAccumulator(str(folder), size_guidance={"scalars": 0})
    board.Reload()
    return board


@pytest.mark.parametrize(
    ("stop", "said"),
    [
        (
            KeyboardInterrupt(),
            r"^stopped in its evaluation; go on with: \S*python\S* -m layoutrl\.train resume=.*/one$",
        ),
        (
            OSError(errno.ENOSPC, "No space left on device"),
            r"cannot write to .*/one \(No space .*\); .* resume=.*/one$",
        ),
    ],
)
def test_an_evaluation_that_is_stopped_is_done_later(stop, said, whole, tmp_path, monkeypatch):
    folder = copy_of(whole, tmp_path)

    def stopped(*_: Any, **__: Any) -> None:
        with pytest.raises(InputError, match="in use by another process"), locked(folder / LOCK, wait=False):
            pass
        raise stop

    with monkeypatch.context() as patch:
        patch.setattr("layoutrl.runs.report.evaluate", stopped)
        with pytest.raises(InputError, match=said):
            resume_run(folder, run, TrainConfig)
    assert outcome(resume_run(folder, run, TrainConfig)) == outcome(whole)


def test_nothing_is_given_beside_the_run_to_go_on_with(whole, tmp_path):
    done = command("train", f"resume={whole}", "seed=3", cwd=tmp_path)
    assert done.returncode != 0
    assert (
        "resume: goes on as it began; expected nothing beside it but data.root, data.categories, device, got seed=3"
        in done.stderr
    )
    done = command("train", f"resume={tmp_path / 'nowhere'}", cwd=tmp_path)
    assert "nowhere" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_sweep_leaves_out_what_fails_and_goes_on_where_it_stopped(rooms, tmp_path):
    arguments = (
        "-m", "room=tatami,study", "seed=0,1", "data=json", f"data.root={rooms}", *SHORT,
        "method.updates.smoke=8", "budget.reports=4", "budget.evaluations=2",
    )  # fmt: skip
    done = command("train", *arguments, cwd=tmp_path)
    failed = re.findall(r"error: runs/study/json-main-geometric-smoke-seed\d: ", done.stderr)
    assert len(failed) == 2  # no study among the rooms
    assert done.returncode == 1
    assert "runs/study/json-main-geometric-smoke-seed0 failed; all that failed is said above\n" in done.stderr
    assert "Traceback" not in done.stderr
    finished = sorted(file.parent.name for file in tmp_path.glob("runs/tatami/*/evaluation.json"))
    assert finished == [f"json-main-geometric-smoke-seed{seed}" for seed in (0, 1)]
    unfinished = tmp_path / "runs" / "tatami" / finished[1]
    (unfinished / "evaluation.json").unlink()
    written = (tmp_path / "runs" / "tatami" / finished[0] / "evaluation.json").stat().st_mtime_ns
    again = command("train", *arguments, cwd=tmp_path)
    assert f"runs/tatami/{finished[0]} is finished" in again.stdout
    assert "going on after 8 updates" in again.stdout
    assert (tmp_path / "runs" / "tatami" / finished[0] / "evaluation.json").stat().st_mtime_ns == written
    assert (unfinished / "evaluation.json").exists()
    assert len(list(tmp_path.glob("runs/tatami/*"))) == 2


def test_a_sweep_tells_apart_what_its_runs_names_do_not(rooms, tmp_path):
    other = tmp_path / "other.jsonl"
    other.write_text(Path(rooms).read_text())
    swept = ("-m", "room=tatami", "data=json", f"data.root={rooms},other.jsonl", "fold=0,1")
    arguments = (*swept, *SHORT, "method.updates.smoke=2", "budget.reports=1", "budget.evaluations=1")
    command("train", *arguments, cwd=tmp_path)
    name = "json-main-geometric-smoke-seed0"
    made = [name, f"{name}-2", f"{name}-3", f"{name}-4"]
    assert sorted(file.parent.name for file in tmp_path.glob("runs/tatami/*/evaluation.json")) == made
    (tmp_path / "runs" / "tatami" / made[2] / "evaluation.json").unlink()
    again = command("train", *arguments, cwd=tmp_path)
    assert again.stdout.count("is finished") == 3
    assert "going on after 2 updates" in again.stdout
    assert sorted(folder.name for folder in tmp_path.glob("runs/tatami/*")) == made


def test_files_that_are_named_from_here_are_those_that_a_run_names(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("more.yaml").write_text("{}")
    for name in range(10):
        home_file(tmp_path / "homes" / f"{name}.sh3d")
    names = ("room=bedroom", "data=sweethome3d", "data.root=homes", "data.categories=more.yaml")
    few = ("method.updates.smoke=2", "budget.reports=1", "budget.evaluations=1")
    config = narrowed(composed("train", *names, f"runs={tmp_path}", "name=one", *SHORT, *few), TrainConfig)
    folder = run(config)
    assert resume.find_begun_run(config) == folder
    assert trained_run(RunConfig(str(folder))).data.categories == str(tmp_path / "more.yaml")
    (folder / "evaluation.json").unlink()
    resume_run(folder, run, TrainConfig)
    other = replace(config, data=replace(config.data, categories="other.yaml"))
    assert resume.find_begun_run(other) is None


def test_what_is_given_takes_the_place_of_what_the_run_says(whole):
    given = trained_run(RunConfig(str(whole), data=replace(AS_IN_THE_RUN, unit="m", strict=True)))
    assert given.data == replace(trained_run(RunConfig(str(whole))).data, unit="m", strict=True)


def test_rooms_that_are_named_from_here_are_known_as_the_runs_own(rooms, whole, monkeypatch):
    monkeypatch.chdir(rooms.parent)
    data = Data("json", rooms.name, labels=None, train_rooms=None, test_rooms=None, seed=None)
    shown = [trained_run(RunConfig(str(whole), data=replace(data, root=root))) for root in (rooms.name, str(rooms))]
    assert [s.part for s in shown] == ["held_out", "held_out"]
    assert shown[0].name == shown[1].name
    other = trained_run(RunConfig(str(whole), part="training"))
    assert other.name != shown[0].name.replace("held_out", "training")  # other rooms, another hash
