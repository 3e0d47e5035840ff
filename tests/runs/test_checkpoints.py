"""Checkpoints stay whole, whatever is on the disk."""

from __future__ import annotations

import errno
import hashlib
import json
import os
from pathlib import Path
from typing import Any

import pytest
import torch

import layoutrl
from layoutrl import InputError
from layoutrl.runs import checkpoints as checkpoints_module
from layoutrl.runs import files
from layoutrl.runs.checkpoints import checkpoints, load_checkpoint, save_checkpoint

CPU = torch.device("cpu")
STATE = {"version": layoutrl.__version__, "config": {"seed": 3}, "rooms": "", "seconds": 1.0, "training": {}}


def test_the_last_two_checkpoints_and_the_best_are_kept(tmp_path):
    for updates, iou in ((10, 0.5), (20, 0.9), (30, 0.7), (40, 0.6), (50, None)):
        save_checkpoint(tmp_path, STATE | {"updates": updates}, updates, iou)
    assert [(checkpoint.updates, checkpoint.iou) for checkpoint in checkpoints(tmp_path)] == [
        (50, None), (40, 0.6), (20, 0.9),
    ]  # fmt: skip
    assert len(list((tmp_path / "checkpoints").iterdir())) == 6
    assert load_checkpoint(tmp_path, CPU)["updates"] == 50
    assert load_checkpoint(tmp_path, CPU, "best")["updates"] == 20


def test_what_was_damaged_gives_way_to_what_goes_on_before_it(tmp_path):
    for updates, iou in ((10, 0.9), (20, 0.4), (30, 0.5)):
        save_checkpoint(tmp_path, STATE, updates, iou)
    for checkpoint in checkpoints(tmp_path)[:2]:
        checkpoint.file.write_bytes(b"")
    save_checkpoint(tmp_path, STATE, 15)
    assert [checkpoint.updates for checkpoint in checkpoints(tmp_path)] == [15, 10]
    assert len(list((tmp_path / "checkpoints").iterdir())) == 4


@pytest.mark.parametrize("step", ["write", "fsync", "replace"])
@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EROFS, errno.EACCES, errno.ENOENT])
def test_what_cannot_be_written_is_answered_and_the_last_checkpoint_stays_whole(step, code, tmp_path, monkeypatch):
    state = STATE | {"updates": 10}
    save_checkpoint(tmp_path, state, 10)

    def fails(*_: Any) -> Any:
        raise OSError(code, os.strerror(code))

    opens = Path.open
    if step == "write":
        monkeypatch.setattr(Path, "open", lambda *a, **k: fails() if "wb" in a else opens(*a, **k))
    elif step == "fsync":
        monkeypatch.setattr(files.os, "fsync", fails)
    else:
        monkeypatch.setattr(Path, "replace", fails)
    with pytest.raises(InputError) as caught:
        save_checkpoint(tmp_path, state | {"updates": 20}, 20)
    monkeypatch.undo()
    assert f"00000020.pt ({os.strerror(code)}); that of 10 updates is whole" in str(caught.value)
    assert load_checkpoint(tmp_path, CPU)["updates"] == 10
    assert not list(tmp_path.rglob("*.partial"))


def test_a_checkpoint_of_another_format_is_refused_also_one_that_says_none(tmp_path):
    save_checkpoint(tmp_path, STATE, 10)
    save_checkpoint(tmp_path, {"format": 3, "version": "9.9.9"}, 20)
    with pytest.raises(InputError, match=rf"is of format 3, of layoutrl 9\.9\.9; expected 2, of {layoutrl.__name__}"):
        load_checkpoint(tmp_path, CPU)
    written(tmp_path, 20, STATE | {"version": layoutrl.__version__})  # of an unreleased state of this version
    with pytest.raises(
        InputError, match=r"is of format 1, of another layoutrl [^ ]+; expected 2: train it again"
    ) as told:
        load_checkpoint(tmp_path, CPU)
    assert str(told.value).count(layoutrl.__version__) == 1
    written(tmp_path, 20, STATE | {"version": "0.1.0"})
    with pytest.raises(InputError, match=r"is of format 1, of layoutrl 0\.1\.0; expected 2, .*: train it again"):
        load_checkpoint(tmp_path, CPU)


def test_a_checkpoint_of_another_configuration_is_refused_with_the_difference(tmp_path):
    save_checkpoint(tmp_path, STATE, 10)
    assert load_checkpoint(tmp_path, CPU, config={"seed": 3}) == STATE | {"format": 2}
    with pytest.raises(InputError, match=r"00000010\.pt is of another seed; expected the same as in config\.yaml"):
        load_checkpoint(tmp_path, CPU, config={"seed": 4})


def test_what_is_taken_instead_of_a_damaged_checkpoint_is_said_once_of_each(tmp_path, capsys):
    for updates, iou in ((10, 0.9), (20, 0.4), (30, 0.5)):
        save_checkpoint(tmp_path, STATE, updates, iou)
    for file in (tmp_path / "checkpoints").glob("*.pt"):
        file.write_bytes(b"")
    with pytest.raises(InputError, match="has no whole checkpoint"):
        load_checkpoint(tmp_path, CPU, "best")
    said = [line.replace(f"{tmp_path}/checkpoints/", "") for line in capsys.readouterr().err.splitlines()]
    assert said == [
        "00000010.pt is damaged (its hash is another); 00000030.pt is taken instead",
        "00000030.pt is damaged (its hash is another); 00000020.pt is taken instead",
        "00000020.pt is damaged (its hash is another); there is no other",
    ]


@pytest.mark.parametrize(
    "error",
    [
        RuntimeError("[enforce fail at alloc_cpu.cpp:128] err == 0. DefaultCPUAllocator: can't allocate memory: 12"),
        torch.OutOfMemoryError("CUDA out of memory"),
        MemoryError(),
    ],
)
def test_a_memory_that_is_too_small_says_nothing_of_a_checkpoint(error, tmp_path, monkeypatch, capsys):
    for updates in (10, 20):
        save_checkpoint(tmp_path, STATE, updates)

    def fails(*_: Any, **__: Any) -> Any:
        raise error

    monkeypatch.setattr(torch, "load", fails)
    with pytest.raises(type(error)):
        load_checkpoint(tmp_path, CPU)
    assert capsys.readouterr().err == ""
    with pytest.raises(type(error)), checkpoints_module.misfit_explained(tmp_path):
        fails()


@pytest.mark.parametrize("mark", ["", "[]", "{}", '{"updates": Infinity, "iou": null, "sha256": ""}'])
def test_a_damaged_mark_costs_its_checkpoint_alone(mark, tmp_path, capsys):
    save_checkpoint(tmp_path, STATE, 10)
    file = tmp_path / "checkpoints" / "00000020.json"
    file.write_text(mark)
    assert [checkpoint.updates for checkpoint in checkpoints(tmp_path)] == [10]
    assert f"{file} cannot be read (" in capsys.readouterr().err


def test_what_is_no_state_is_not_told_as_one_of_an_older_format(tmp_path, capsys):
    written(tmp_path, 20, {"weights": torch.ones(2)})
    with pytest.raises(InputError, match="has no whole checkpoint"):
        load_checkpoint(tmp_path, CPU)
    assert "00000020.pt is damaged (it is no state of a training); there is no other" in capsys.readouterr().err


@pytest.mark.parametrize("name", [None, *checkpoints_module.STATE])
@pytest.mark.parametrize("value", [None, [], 3, torch.ones(2)])
def test_whatever_is_saved_under_a_right_hash_a_state_of_a_training_is_taken(name, value, tmp_path, capsys):
    save_checkpoint(tmp_path, STATE, 10)
    written(tmp_path, 20, value if name is None else STATE | {"format": 2, name: value})
    assert load_checkpoint(tmp_path, CPU) == STATE | {"format": 2}
    assert f"00000020.pt is damaged (it is no state of a training{': it lacks ' + name if name else ''})" in (
        capsys.readouterr().err
    )


def written(folder: Path, updates: int, content: Any) -> None:
    """Write a checkpoint of whatever content, under a right mark."""
    save_checkpoint(folder, {}, updates)
    file = folder / "checkpoints" / f"{updates:08d}.pt"
    torch.save(content, file)
    mark = {"updates": updates, "iou": None, "sha256": hashlib.sha256(file.read_bytes()).hexdigest()}
    file.with_suffix(".json").write_text(json.dumps(mark))
