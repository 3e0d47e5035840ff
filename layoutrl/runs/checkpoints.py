"""Checkpoints of a run: written atomically, each with a mark file that has its hash. No code in one is ever run."""

from __future__ import annotations

import hashlib
import io
import json
import pickle
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import layoutrl
from layoutrl import InputError
from layoutrl.runs.commands import out_of_memory
from layoutrl.runs.files import write_whole
from layoutrl.runs.folder import differences

if TYPE_CHECKING:
    import torch  # it takes seconds

CHECKPOINTS = "checkpoints"  # folder of a run
KEPT = 2  # latest checkpoints, beside the best
FORMAT = 2  # of checkpoints; no other can be read. In format 1, of layoutrl 0.1 and 0.2, agents saw no facings.
STATE = {"config": dict, "rooms": str, "seconds": float, "training": dict}  # what a checkpoint holds, at least


def save_checkpoint(folder: Path, state: dict[str, Any], updates: int, iou: float | None = None) -> None:
    """Save a state (tensors and plain values) as `checkpoints/<updates>.pt`, whole or not at all.

    A mark file beside it, written last, has its hash, and the mean IoU in training rooms if it was measured. The last
    two checkpoints and the best are kept. Raises InputError if it cannot be written; earlier ones stay whole.
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
        write_whole(file, content)
        write_whole(file.with_suffix(".json"), (json.dumps(mark) + "\n").encode())
    except OSError as error:
        before = checkpoints(folder)
        safe = f"that of {before[0].updates} updates is whole" if before else "no checkpoint was saved before"
        raise InputError(f"runs: cannot write {file} ({error.strerror}); {safe}; expected a disk to write to") from None
    marks = checkpoints(folder)
    later = [mark for mark in marks if mark.updates > updates]  # damaged: training resumed from before them
    marks = marks[len(later) :]
    for old in [*later, *marks[KEPT:]]:
        if old != best(marks):
            old.file.with_suffix(".json").unlink()  # the mark first: without one a file is no checkpoint
            old.file.unlink(missing_ok=True)


class Checkpoint(NamedTuple):
    """A checkpoint, as its mark file describes it."""

    updates: int
    iou: float | None  # mean in training rooms; None: not measured
    sha256: str
    file: Path


def checkpoints(folder: Path) -> list[Checkpoint]:
    """Return the checkpoints of a run, the last one first. Prints which marks cannot be read, and leaves these out."""
    found = []
    for mark in (folder / CHECKPOINTS).glob("*.json"):
        try:
            said = json.loads(mark.read_text(encoding="utf-8"))
            iou = None if said["iou"] is None else float(said["iou"])
            found.append(Checkpoint(int(said["updates"]), iou, str(said["sha256"]), mark.with_suffix(".pt")))
        except (OSError, ValueError, KeyError, TypeError, OverflowError) as error:  # OverflowError: Infinity
            print(f"{mark} cannot be read ({error}); its checkpoint is left out", file=sys.stderr)
    return sorted(found, key=lambda checkpoint: -checkpoint.updates)


def best(found: list[Checkpoint]) -> Checkpoint:
    """Return the one with the highest IoU in training rooms, the last of equals. Held-out rooms must not choose."""
    return max(found, key=lambda checkpoint: -1.0 if checkpoint.iou is None else checkpoint.iou)


def load_checkpoint(
    folder: Path,
    device: torch.device,
    which: Literal["last", "best"] = "last",
    config: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """Load the last state that was saved, or the best; if it is damaged, say so and take another, the latest first.

    No code in a file is run. Raises InputError if all are damaged, and if the first that is not has another format or,
    where `config` is given, another configuration.
    """
    found = checkpoints(folder)
    if which == "best" and found:
        found.sort(key=best(found).__ne__)  # the best first; the others stay in order
    for tried, checkpoint in enumerate(found, 1):
        try:
            state = _whole_state(checkpoint, device)
        except Exception as error:  # torch answers a damaged file with whatever it meets in it
            if out_of_memory(error):  # it says nothing of what is in the file
                raise
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            if isinstance(error, pickle.UnpicklingError):  # torch's own words say how to run what is in it
                reason = "it holds other things than tensors and plain values"
            rest = found[tried:]
            instead = f"{rest[0].file.name} is taken instead" if rest else "there is no other"
            print(f"{checkpoint.file} is damaged ({reason}); {instead}", file=sys.stderr)
            continue
        if (theirs := state.get("format", 1)) != FORMAT:
            another, ours = "", f", of layoutrl {layoutrl.__version__}"
            if state["version"] == layoutrl.__version__:
                another, ours = "another ", ""
            raise InputError(
                f"{checkpoint.file} is of format {theirs}, of {another}layoutrl {state['version']}; "
                f"expected {FORMAT}{ours}: train it again"
            )
        if config and (others := differences(state["config"], config)):
            raise InputError(
                f"{checkpoint.file} is of another {', '.join(others)}; expected the same as in config.yaml"
            )
        return state
    raise InputError(f"{folder / CHECKPOINTS} has no whole checkpoint; expected those of a training run")


def _whole_state(checkpoint: Checkpoint, device: torch.device) -> dict[str, Any]:
    """Return the state in a file. Raises ValueError, or whatever torch meets in it, if it is damaged."""
    import torch

    content = checkpoint.file.read_bytes()
    if hashlib.sha256(content).hexdigest() != checkpoint.sha256:
        raise ValueError("its hash is another")
    state = torch.load(io.BytesIO(content), map_location=device, weights_only=True)
    if not isinstance(state, dict) or not isinstance(state.get("version"), str):
        raise ValueError("it is no state of a training")
    missing = [name for name, kind in STATE.items() if not isinstance(state.get(name), kind)]
    if missing and state.get("format", 1) == FORMAT:  # another format may hold other things
        raise ValueError(f"it is no state of a training: it lacks {', '.join(missing)}")
    return state


@contextmanager
def misfit_explained(folder: Path) -> Iterator[None]:
    """Context that raises InputError if a checkpoint does not fit: torch raises many kinds of errors for that."""
    try:
        yield
    except Exception as error:
        if out_of_memory(error):
            raise
        reason = " ".join(str(error).split())
        raise InputError(
            f"the checkpoint of {folder} does not fit ({type(error).__name__}: {reason:.200}); "
            "expected what a training as in config.yaml leaves"
        ) from None
