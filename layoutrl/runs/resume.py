"""Stopping and resuming runs: stopped by a signal, resumed with `resume=` or by repeating a sweep."""

from __future__ import annotations

import os
import shlex
import shutil
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import Any, Protocol

import torch
from hydra.core.hydra_config import HydraConfig
from hydra.errors import CompactHydraException
from hydra.types import RunMode

from layoutrl import InputError, __version__
from layoutrl.rooms.collection import digest
from layoutrl.rooms.room import Room
from layoutrl.runs.checkpoints import CHECKPOINTS, checkpoints, load_checkpoint, misfit_explained, save_checkpoint
from layoutrl.runs.commands import Stopped, in_a_line, mendable
from layoutrl.runs.config import AnyTraining, Config
from layoutrl.runs.files import LOCK, check_writable, locked, write_json
from layoutrl.runs.folder import (
    check_there,
    differences,
    folders_of,
    load_config,
    located,
    new_folder,
    stated,
    wanted_folder,
)
from layoutrl.runs.machine import machine

EVALUATION = "evaluation.json"  # a run that has it is finished

# Windows has no SIGHUP.
STOPPING = [signal.Signals[name] for name in ("SIGINT", "SIGTERM", "SIGHUP") if name in signal.Signals.__members__]

ELSEWHERE = ("data.root", "data.categories", "device")  # options that may change when a run is resumed

Run = Callable[[Config, Path | None], Path]  # does a run as configured: a new one, or the one in a folder


class Stoppable(Protocol):
    """A training that ends after the current update if `stopping` is set, and resumes exactly from its state."""

    stopping: bool

    @property
    def updates(self) -> int: ...

    def state_dict(self) -> dict[str, Any]: ...

    def load_state_dict(self, state: dict[str, Any]) -> None: ...


def going_on(folder: Path, config: AnyTraining) -> str:
    """Return the shell command that resumes a run, with those options of ELSEWHERE that differ from its config.yaml."""
    schema: type[Any] = type(config)
    ours, theirs = (where(each) for each in (config, load_config(folder, schema)))
    others = [f"{name}={value}" for name, value in ours.items() if value != theirs[name]]
    return shlex.join([interpreter(), "-m", config.module, f"resume={folder}", *others])


def stopped(folder: Path, config: AnyTraining, made: int, total: int) -> Stopped:
    """Return the error of a training that the user stopped after so many of all updates, with how it goes on."""
    when = f"after {made} of {total} updates" if made < total else "before its evaluation"
    return Stopped(f"stopped {when}", going_on(folder, config))


def interpreter() -> str:
    """Return how a shell calls this Python: `python` where that is it, else its path, from here if it lies below."""
    if shutil.which("python") == sys.executable:
        return "python"
    here = Path(sys.executable)
    return str(here.relative_to(Path.cwd()) if here.is_relative_to(Path.cwd()) else here)


def where(config: AnyTraining) -> dict[str, Any]:
    """Return the values of the options of ELSEWHERE, paths made absolute."""
    data = located(config.data)
    return dict(zip(ELSEWHERE, (data.root, data.categories, config.device), strict=True))


def check_folder(config: AnyTraining, folder: Path | None) -> None:
    """Raise InputError if a new run, or one to resume, cannot be written to or is in use by another process.

    To be called before rooms are made, which takes a while.
    """
    if folder is None:
        check_writable(wanted_folder(config).parent, "runs")
    else:
        with locked(folder / LOCK, wait=False):
            pass


class Session:
    """A training in the folder of its run."""

    def __init__(self, training: Stoppable, folder: Path, about: dict[str, Any], seconds_before: float):
        self.folder = folder
        self._training, self._about = training, about
        self._began = time.perf_counter() - seconds_before

    @property
    def seconds(self) -> float:
        """Seconds of training so far, those before the run was resumed included."""
        return time.perf_counter() - self._began

    def save(self, iou: float | None) -> None:
        """Save a checkpoint, with the IoU in training rooms if known. Raises InputError if a value is not finite."""
        training = self._training.state_dict()
        if not finite(training):
            raise InputError(
                f"method: a value is no number after {self._training.updates} updates, which are not saved; begin "
                "another run with a lower method.learning_rate"
            )
        state = self._about | {"seconds": self.seconds, "training": training}
        save_checkpoint(self.folder, state, self._training.updates, iou)


@contextmanager
def session(
    training: Stoppable,
    config: AnyTraining,
    rooms: Sequence[Room],
    folder: Path | None,
    device: torch.device,
    **about: Any,
) -> Iterator[Session]:
    """Context of a training: resumes the run in `folder`, if given, and saves a checkpoint at the end or at a signal.

    Checkpoints also have `about` and torch's number of threads, which a resumed run gets again, as sums depend on it.
    Raises InputError if the folder cannot be written to, is of another run, or is in use by another process.
    """
    identity, seconds_before = identity_of(config, rooms, device), 0.0
    begun, folder = folder is not None, folder or new_folder(config)
    with locked(folder / LOCK, wait=False):
        if begun and (state := last_state(folder, identity, about, device)):
            with misfit_explained(folder):
                training.load_state_dict(state["training"])
                threads = state.get("threads", torch.get_num_threads())  # older checkpoints lack it
                if threads != torch.get_num_threads():
                    print(f"on {threads} threads, as it began, instead of {torch.get_num_threads()}")
                    torch.set_num_threads(threads)
            print(f"going on after {training.updates} updates")
            seconds_before = state["seconds"]
        about |= {"threads": torch.get_num_threads()}
        kept = Session(training, folder, identity | about, seconds_before)
        print(f"in {folder}")
        with write_errors_explained(folder, config, training), stopped_by_signals(training):
            yield kept
            if [c.updates for c in checkpoints(folder)[:1]] != [training.updates]:
                kept.save(None)
    print(f"trained {training.updates} updates in {kept.seconds / 60:.1f} minutes on {device}")


@contextmanager
def write_errors_explained(folder: Path, config: AnyTraining, training: Stoppable) -> Iterator[None]:
    """Context that raises InputError for an OSError, with the command that resumes. Checkpoints raise their own."""
    try:
        yield
    except OSError as error:
        begins = "the last checkpoint goes on" if checkpoints(folder) else "it begins anew, as nothing is saved yet"
        raise InputError(
            f"runs: cannot write to {folder} ({error.strerror}) after {training.updates} updates; expected a disk "
            f"to write to, where {begins}: {going_on(folder, config)}"
        ) from None


@contextmanager
def evaluation_session(folder: Path, config: AnyTraining) -> Iterator[None]:
    """Context of the evaluation of a trained run, its folder locked. If the user stops it, `resume=` does it later.

    Raises Stopped then, and InputError if the folder cannot be written to or is in use by another process.
    """
    with locked(folder / LOCK, wait=False):
        try:
            yield
        except KeyboardInterrupt:
            raise Stopped("stopped in its evaluation", going_on(folder, config)) from None
        except OSError as error:
            raise InputError(
                f"runs: cannot write to {folder} ({error.strerror}); expected a disk to write to, and then: "
                f"{going_on(folder, config)}"
            ) from None


def finish(
    folder: Path,
    config: AnyTraining,
    result: dict[str, Any],
    shown: str,
    *,
    device: torch.device,
    updates: int,
    seconds: float,
) -> None:
    """Write the evaluation of a run, which marks the run as finished, and print `shown`."""
    about = {"config": stated(config), "machine": machine(device), "updates": updates, "training_seconds": seconds}
    write_json(folder / EVALUATION, about | result)  # last: a run that has it is finished
    print(shown)
    print(f"wrote {folder}")


def start_or_resume(config: Config, resume: str | None, run: Run[Config]) -> None:
    """Do what a command line asks for: a run, one run of a sweep, or resuming a run.

    Raises InputError if `resume` is empty, or given together with other options than those of ELSEWHERE.
    """
    hydra_config = HydraConfig.get()
    if resume is None:
        if hydra_config.mode == RunMode.MULTIRUN:
            run_in_sweep(config, run)
        else:
            run(config, None)
        return
    if not resume.strip():
        raise InputError("resume: expected the folder of a run; got no name")
    given = {each.partition("=")[0]: each for each in hydra_config.overrides.task}
    if also := [each for name, each in given.items() if name not in ("resume", *ELSEWHERE)]:
        raise InputError(
            f"resume: goes on as it began; expected nothing beside it but {', '.join(ELSEWHERE)}, got {' '.join(also)}"
        )
    resume_run(Path(resume), run, type(config), {name: value for name, value in where(config).items() if name in given})


def resume_run(
    folder: Path, run: Run[Config], schema: type[Config], elsewhere: Mapping[str, str | None] | None = None
) -> Path:
    """Resume a run, unless it is finished, and return its folder. `elsewhere` has new values of options of ELSEWHERE.

    Raises InputError if the folder is not that of such a run, or its rooms do not exist.
    """
    config = load_config(folder, schema, "resume")
    root, categories, device = (where(config) | dict(elsewhere or {})).values()
    if (folder / EVALUATION).exists():
        print(f"{folder} is finished")
        return folder
    config = replace(config, data=replace(config.data, root=root, categories=categories), device=device)
    check_there(folder, config.data)
    threads = torch.get_num_threads()
    try:
        return run(config, folder)
    finally:
        torch.set_num_threads(threads)  # for the next run of a sweep


def run_in_sweep(config: Config, run: Run[Config]) -> None:
    """Do one run of a sweep: skip it if it is finished, resume it if it is begun. An error in it stops no other run.

    Raises Stopped if the user stops it, and for an error CompactHydraException, which Hydra prints in a line when the
    last run has ended.
    """
    try:
        if folder := find_begun_run(config):
            resume_run(folder, run, type(config), where(config))
        else:
            run(config, None)
    except Stopped:
        raise
    except Exception as error:  # whatever it is: the other runs shall not suffer
        what = f": {in_a_line(error)}" if mendable(error) else ""
        print(f"error: {wanted_folder(config)}{what}", file=sys.stderr)
        if not what:
            traceback.print_exc()
    else:
        return
    raise CompactHydraException(f"{wanted_folder(config)} failed; all that failed is said above")


def find_begun_run(config: Config) -> Path | None:
    """Return the folder of the run of this configuration and data, if begun; others may have its name with a number."""
    for folder in folders_of(wanted_folder(config)):
        with suppress(InputError):  # a run of another kind
            theirs = load_config(folder, type(config))
            ours = located(config.data)
            same_files = (theirs.data.root, theirs.data.categories) == (ours.root, ours.categories)
            if (config.data.source == "designer" or same_files) and not differences(stated(theirs), stated(config)):
                return folder
    return None


def identity_of(config: AnyTraining, rooms: Sequence[Room], device: torch.device) -> dict[str, Any]:
    """Return what a checkpoint records of its run. To resume the run, all but the version must agree."""
    return {"version": __version__, "config": stated(config), "rooms": digest(rooms), "device": device.type}


def last_state(
    folder: Path, identity: dict[str, Any], about: dict[str, Any], device: torch.device
) -> dict[str, Any] | None:
    """Load the last checkpoint of a run; None for a run that was killed before its first one, which begins anew.

    Raises InputError if none can be read, and if it has other rooms or settings, another kind of device, or another
    `about`.
    """
    if not checkpoints(folder):
        if any((folder / CHECKPOINTS).glob("*.json")):  # a mark is written last: what it marks is worth saving
            raise InputError(f"{folder / CHECKPOINTS} has no mark that can be read; expected those of a training run")
        print(f"{folder} has no checkpoint yet: it begins anew")
        return None
    state = load_checkpoint(folder, device, config=identity["config"])
    if state["rooms"] != identity["rooms"]:
        raise InputError(f"the checkpoint of {folder} is of other rooms; expected those that it began with")
    ours = identity["device"]  # generators of another would draw differently
    if (theirs := state.get("device", "a device that it does not tell")) != ours:
        raise InputError(
            f"the checkpoint of {folder} is of {theirs}; expected to go on there, got {ours} "
            "(an empty CUDA_VISIBLE_DEVICES hides a GPU)"
        )
    if others := [name for name, value in about.items() if state.get(name) != value]:
        raise InputError(
            f"the checkpoint of {folder} has other {', '.join(others)}; expected the version of layoutrl that "
            "began the run"
        )
    return state


def finite(state: Any) -> bool:
    """Whether all numbers in the tensors of a state are finite."""
    if isinstance(state, torch.Tensor):
        return bool(state.isfinite().all())
    parts = state.values() if isinstance(state, dict) else state if isinstance(state, list | tuple) else ()
    return all(map(finite, parts))


@contextmanager
def stopped_by_signals(training: Stoppable) -> Iterator[None]:
    """Context in which SIGINT, SIGTERM and SIGHUP end a training after the current update; a second ends the program.

    Signals that are ignored, as by nohup, stay ignored.
    """

    def stop(number: int, _: FrameType | None) -> None:
        training.stopping = True
        signal.signal(number, before[signal.Signals(number)])
        told = b"\nstops after this update, and saves; the same signal again: stops at once, and does not save\n"
        with suppress(OSError):  # of a terminal that is gone, which is when SIGHUP comes
            if sys.stderr:
                os.write(2, told)  # not by print, which may be what was interrupted

    main = threading.current_thread() is threading.main_thread()  # no other thread can handle signals
    heard = [n for n in STOPPING if main and signal.getsignal(n) not in (signal.SIG_IGN, None)]
    before = {number: signal.signal(number, stop) for number in heard}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
