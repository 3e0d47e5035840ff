"""The folder of a run: config.yaml, checkpoints/, metrics.csv, evaluation.json, TensorBoard events; the machine."""

from __future__ import annotations

import hashlib
import io
import json
import os
import pickle
import re
import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import yaml
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

import layoutrl
from layoutrl import InputError
from layoutrl.rooms.sources.parts import Data
from layoutrl.runs.config import AnyTraining, Config, misfit

if TYPE_CHECKING:
    import torch  # it takes seconds, and only checkpoints need it

CHECKPOINTS = "checkpoints"  # folder of a run
LOCK = "lock"  # of a run that is trained
POLL = 0.1  # seconds between two attempts to lock a file, where the system cannot wait for it
KEPT = 2  # checkpoints, beside the best
LARGEST, DEEPEST = 10_000, 10  # bytes and levels of a config.yaml; those that are written have 1,300 and 4
FORMAT = 2  # of checkpoints: those of another cannot be read. In 1, of layoutrl 0.1 and 0.2, agents saw no facings.
STATE = {"config": dict, "rooms": str, "seconds": float, "training": dict}  # what a checkpoint holds, at least


def wanted_folder(config: AnyTraining) -> Path:
    """`runs/<room>/<name>`."""
    labels = f"-{config.data.labels}" if config.data.source == "floorplans" else ""
    item = "rooms" if getattr(config.method, "scope", "item") == "room" else config.room.item
    name = config.name or (
        f"{config.data.source}{labels}-{item}-{config.method.name}-{config.budget.name}-seed{config.seed}"
    )
    return Path(config.runs) / config.room.type / name


def new_folder(config: AnyTraining) -> Path:
    """The wanted one, with a number behind it where that is taken: no run overwrites another. Holds config.yaml.

    Raises InputError where it cannot be written to.
    """
    kept = OmegaConf.structured(replace(config, data=located(config.data)))
    folder = make_folder(wanted_folder(config))
    try:
        _write(folder / "config.yaml", OmegaConf.to_yaml(kept).encode())
    except OSError as error:
        shutil.rmtree(folder)
        raise InputError(f"runs: cannot write to {folder} ({error.strerror}); expected a disk to write to") from None
    return folder


def folders_of(wanted: Path) -> list[Path]:
    """Those that `make_folder` has made of one name."""
    numbered = re.compile(rf"{re.escape(wanted.name)}(-\d+)?")
    return [folder for folder in sorted(wanted.parent.glob("*")) if numbered.fullmatch(folder.name)]


def located(data: Data) -> Data:
    """The same data, wherever the run is read from."""
    root, categories = (path and str(Path(path).expanduser().absolute()) for path in (data.root, data.categories))
    return replace(data, root=root, categories=categories)


def make_folder(wanted: Path) -> Path:
    """A new folder: the one that is wanted, with a number behind its name where that is taken."""
    attempt = 1
    while True:
        folder = wanted if attempt == 1 else wanted.with_name(f"{wanted.name}-{attempt}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            attempt += 1
        except OSError as error:
            raise InputError(
                f"runs: cannot create {folder} ({error.strerror}); expected a folder to write to"
            ) from None
        else:
            return folder


@contextmanager
def locked(file: Path, *, wait: bool) -> Iterator[None]:
    """Inside, no other process holds the file; waits for one that does. However a process ends, it lets go of it.

    Raises InputError where one holds it that is not to be waited for, and where files cannot be locked.
    """
    try:
        stream = file.open("w")  # to be written to: without it, file systems of clusters lock nothing
    except OSError as error:
        raise InputError(f"runs: cannot write {file} ({error.strerror}); expected a folder to write to") from None
    with stream:
        try:
            _lock(stream.fileno(), wait)
        except BlockingIOError:
            raise InputError(f"run: {file.parent} is in use by another process; expected it to end first") from None
        except OSError as error:
            raise InputError(
                f"runs: cannot lock {file} ({error.strerror}); expected a folder on a file system with locks"
            ) from None
        yield


def _lock(descriptor: int, wait: bool) -> None:
    """Lock an open file until it is closed.

    Raises BlockingIOError where another has locked it and is not to be waited for, OSError where it cannot be locked.
    """
    if sys.platform == "win32":
        import msvcrt

        while True:
            try:
                msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # the first byte, which need not be there
                return
            except PermissionError:  # another has it; Windows' own way of waiting gives up after ten seconds
                if not wait:
                    raise BlockingIOError from None
                time.sleep(POLL)
    else:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)


def save_checkpoint(folder: Path, state: dict[str, Any], updates: int, iou: float | None = None) -> None:
    """Keep a state (tensors and plain values) as `checkpoints/<updates>.pt`, whole or not at all.

    A mark beside it, written last, has its hash, and the mean IoU in training rooms if it was asked for. The last two
    and the best are kept. Raises InputError where it cannot be written; those before it stay whole.
    """
    import torch

    buffer = io.BytesIO()
    torch.save({"format": FORMAT} | state, buffer)
    content = buffer.getvalue()
    file = folder / CHECKPOINTS / f"{updates:08d}.pt"
    mark = {"sha256": hashlib.sha256(content).hexdigest(), "updates": updates, "iou": iou}
    try:
        file.parent.mkdir(exist_ok=True)
        file.with_suffix(".json").unlink(missing_ok=True)
        _write(file, content)
        _write(file.with_suffix(".json"), (json.dumps(mark) + "\n").encode())
    except OSError as error:
        before = checkpoints(folder)
        safe = f"that of {before[0].updates} updates is whole" if before else "no checkpoint was saved before"
        raise InputError(f"runs: cannot write {file} ({error.strerror}); {safe}; expected a disk to write to") from None
    marks = checkpoints(folder)
    later = [mark for mark in marks if mark.updates > updates]  # damaged, and what it went on from was before them
    marks = marks[len(later) :]
    for old in [*later, *marks[KEPT:]]:
        if old != best(marks):
            old.file.with_suffix(".json").unlink()  # the mark first: what has none is none
            old.file.unlink(missing_ok=True)


class Checkpoint(NamedTuple):
    """What the mark of one says."""

    updates: int
    iou: float | None
    sha256: str
    file: Path


def checkpoints(folder: Path) -> list[Checkpoint]:
    """Those of a run that have a mark that can be read, the last one first."""
    found = []
    for mark in (folder / CHECKPOINTS).glob("*.json"):
        try:
            said = json.loads(mark.read_text(encoding="utf-8"))
            iou = None if said["iou"] is None else float(said["iou"])
            found.append(Checkpoint(int(said["updates"]), iou, str(said["sha256"]), mark.with_suffix(".pt")))
        except (OSError, ValueError, KeyError, TypeError) as error:
            print(f"{mark} cannot be read ({error}); its checkpoint is left out", file=sys.stderr)
    return sorted(found, key=lambda checkpoint: -checkpoint.updates)


def best(found: list[Checkpoint]) -> Checkpoint:
    """The one with the highest IoU in training rooms, and of equals the last: what is held out chooses nothing."""
    return max(found, key=lambda checkpoint: -1.0 if checkpoint.iou is None else checkpoint.iou)


def load_checkpoint(
    folder: Path,
    device: torch.device,
    which: Literal["last", "best"] = "last",
    config: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """The last whole state that was saved, or the best; says where one is damaged and another is taken.

    Nothing in a file is run. Raises InputError where none is whole, where it is of another format, or of another
    configuration than the run's, if that is given.
    """
    import torch

    found = checkpoints(folder)
    if which == "best" and found:
        found.sort(key=best(found).__ne__)  # it first; the others stay in order
    for tried, checkpoint in enumerate(found, 1):
        try:
            content = checkpoint.file.read_bytes()
            if hashlib.sha256(content).hexdigest() != checkpoint.sha256:
                raise ValueError("its hash is another")
            state = torch.load(io.BytesIO(content), map_location=device, weights_only=True)
            if not isinstance(state, dict) or not isinstance(version := state.get("version"), str):
                raise ValueError("it is no state of a training")
            if (theirs := state.get("format", 1)) != FORMAT:
                raise InputError(
                    f"run: {checkpoint.file} is of format {theirs}, of layoutrl {version}; "
                    f"expected {FORMAT}, of layoutrl {layoutrl.__version__}: train it again"
                )
            if missing := [name for name, kind in STATE.items() if not isinstance(state.get(name), kind)]:
                raise ValueError(f"it is no state of a training: it lacks {', '.join(missing)}")
        except (InputError, MemoryError, torch.OutOfMemoryError):  # says nothing of the one before
            raise
        except Exception as error:  # torch answers a damaged file with whatever it meets in it
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            if isinstance(error, pickle.UnpicklingError):  # torch's own words say how to run what is in it
                reason = "it holds other things than tensors and plain values"
            rest = found[tried:]
            instead = f"{rest[0].file.name} is taken instead" if rest else "there is no other"
            print(f"{checkpoint.file} is damaged ({reason}); {instead}", file=sys.stderr)
            continue
        if config and (others := differences(state["config"], config)):
            raise InputError(
                f"run: {checkpoint.file} is of another {', '.join(others)}; expected the same as in config.yaml"
            )
        return state
    raise InputError(f"run: {folder / CHECKPOINTS} has no whole checkpoint; expected those of a training run")


@contextmanager
def taken(folder: Path) -> Iterator[None]:
    """Answer a checkpoint that holds something else than what takes it: torch meets that in many ways."""
    import torch

    try:
        yield
    except (MemoryError, torch.OutOfMemoryError):  # says nothing of the file
        raise
    except Exception as error:
        reason = " ".join(str(error).split())
        raise InputError(
            f"run: the checkpoint of {folder} does not fit ({type(error).__name__}: {reason:.200}); "
            "expected what a training as in config.yaml leaves"
        ) from None


def differences(first: dict[str, Any], second: dict[str, Any], prefix: str = "") -> list[str]:
    """The dotted names of what both configurations have, and have differently; what it runs on is not counted."""
    names = []
    for name in first.keys() & second.keys() - {"device"}:
        one, other = first[name], second[name]
        if isinstance(one, dict) and isinstance(other, dict):
            names += differences(one, other, f"{prefix}{name}.")
        elif one != other:
            names.append(prefix + name)
    return sorted(names)


def _write(file: Path, content: bytes) -> None:
    """Write a file whole or not at all, and onto the disk before its name is there."""
    partial = file.with_name(f"{file.name}.partial")
    try:
        with partial.open("wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(file)
    except BaseException:  # a full disk has no room for what is of no use
        partial.unlink(missing_ok=True)
        raise


def load_config(folder: Path, schema: type[Config]) -> Config:
    """The resolved configuration of a run. Raises InputError where there is none, or one of another kind of run."""
    path = folder / "config.yaml"
    try:
        with path.open("rb") as file:
            text = file.read(LARGEST + 1).decode()
        _refuse_what_grows(text)
        return OmegaConf.to_object(OmegaConf.merge(schema, OmegaConf.load(io.StringIO(text))))  # type: ignore[return-value]
    except OSError as error:
        reason = error.strerror or "it holds no options"
        raise InputError(f"run: {path} cannot be read ({reason}); expected the folder of a training run") from None
    except OmegaConfBaseException as error:
        reason = misfit(error, schema)
    except (yaml.YAMLError, ValueError, TypeError) as error:  # also for what is out of range
        reason = " ".join(str(error).split())
    raise InputError(
        f"run: {path} is damaged, or of another kind of run ({reason}); expected it as a training wrote it"
    )


def _refuse_what_grows(text: str) -> None:
    """Raise ValueError for what a resolved configuration never holds, and that says more than stands there."""
    if len(text) > LARGEST:
        raise ValueError(f"it is larger than {LARGEST} bytes")
    depth = 0
    for event in yaml.parse(text):
        line = f"line {event.start_mark.line + 1}"
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST:
            raise ValueError(f"{line} is nested deeper than {DEEPEST} levels")
        if getattr(event, "anchor", None):
            raise ValueError(f"{line} has an anchor or an alias, {event.anchor}")
        if "${" in getattr(event, "value", ""):
            raise ValueError(f"{line} has an interpolation, {event.value}")


def write_json(path: Path, content: Any) -> None:
    """Write a file whole or not at all."""
    _write(path, (json.dumps(content, indent=1) + "\n").encode())
