"""The folder of a run: its name, its configuration in config.yaml, and how two differ."""

from __future__ import annotations

import io
import json
import re
import shutil
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import yaml
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from layoutrl import InputError
from layoutrl.rooms.sources.parts import Data
from layoutrl.runs.config import AnyTraining, Config
from layoutrl.runs.files import write_whole
from layoutrl.runs.wording import misfit

NOT_COMPARED = ("device", "room.updates", "room.whole_updates")  # may differ: method.updates has the length
LARGEST, DEEPEST = 10_000, 10  # bytes and levels of a config.yaml, at most; written ones have 1,200 and 4


def wanted_folder(config: AnyTraining) -> Path:
    """Return the folder that a run should have: <runs>/<room type>/<name>, by default named after its options."""
    labels = f"-{config.data.labels}" if config.data.source == "floorplans" else ""
    item = "rooms" if getattr(config.method, "scope", "item") == "room" else config.room.item
    begin = "-package" if getattr(config, "begin", "nothing") == "package" else ""
    name = config.name or (
        f"{config.data.source}{labels}-{item}-{config.method.name}{begin}-{config.budget.name}-seed{config.seed}"
    )
    return Path(config.runs) / config.room.type / name


def new_folder(config: AnyTraining) -> Path:
    """Make the folder of a new run, with its config.yaml. No run overwrites another: see `make_folder`.

    Raises InputError if it cannot be written to.
    """
    kept = OmegaConf.structured(replace(config, data=located(config.data)))
    folder = make_folder(wanted_folder(config))
    try:
        write_whole(folder / "config.yaml", OmegaConf.to_yaml(kept).encode())
    except OSError as error:
        shutil.rmtree(folder)
        raise InputError(f"runs: cannot write to {folder} ({error.strerror}); expected a disk to write to") from None
    return folder


def folders_of(wanted: Path) -> list[Path]:
    """Return the folders that `make_folder` has made for one that was wanted, those with a number included."""
    numbered = re.compile(rf"{re.escape(wanted.name)}(-\d+)?")
    return [folder for folder in sorted(wanted.parent.glob("*")) if numbered.fullmatch(folder.name)]


def located(data: Data) -> Data:
    """Return the data with absolute paths, which hold in any working directory."""
    root, categories = (path and str(Path(path).expanduser().absolute()) for path in (data.root, data.categories))
    return replace(data, root=root, categories=categories)


def moved(own: Data, given: Data) -> Data:
    """Return a run's own data; paths that no longer exist are replaced by given ones, if those are of its source."""
    if given.source not in (None, own.source):
        return own
    found: dict[str, Any] = {name: getattr(given, name) or path for name, path in gone(own).items()}
    return replace(own, **found)


def gone(data: Data) -> dict[str, str]:
    """Return the paths in data that do not exist, by field. Empty for the designer, which makes its cache anew."""
    paths = {} if data.source == "designer" else {"root": data.root, "categories": data.categories}
    return {name: path for name, path in paths.items() if path and not Path(path).exists()}


def check_there(folder: Path, data: Data) -> None:
    """Raise InputError where files of a run's rooms are not there."""
    for name, path in gone(data).items():
        raise InputError(f"data.{name}: {folder} has its rooms of {path}, which is not there; expected where it is now")


def make_folder(wanted: Path) -> Path:
    """A new folder: the one that is wanted, with a number behind its name where that is taken.

    Raises InputError where it cannot be made.
    """
    folder, attempt = wanted, 1
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        while True:
            try:
                folder.mkdir()
            except FileExistsError:
                attempt += 1
                folder = wanted.with_name(f"{wanted.name}-{attempt}")
            else:
                return folder
    except OSError as error:
        raise InputError(f"runs: cannot create {folder} ({error.strerror}); expected a folder to write to") from None


def stated(config: AnyTraining) -> dict[str, Any]:
    """Return the configuration as plain values, without file locations and without the updates of other budgets."""
    said: dict[str, Any] = json.loads(json.dumps(asdict(config))) | {"runs": "", "name": None}
    said["data"] |= {"root": None, "categories": None}
    updates = said["method"]["updates"]
    said["method"]["updates"] = {budget: number for budget, number in updates.items() if budget == config.budget.name}
    return said


def differences(first: dict[str, Any], second: dict[str, Any], prefix: str = "") -> list[str]:
    """Return the dotted names of options, except NOT_COMPARED, that both configurations have with different values."""
    names = []
    for name in first.keys() & second.keys():
        one, other = first[name], second[name]
        if isinstance(one, dict) and isinstance(other, dict):
            names += differences(one, other, f"{prefix}{name}.")
        elif one != other and prefix + name not in NOT_COMPARED:
            names.append(prefix + name)
    return sorted(names)


def load_config(folder: Path, schema: type[Config], option: str = "run") -> Config:
    """Load the configuration of a run from its folder; `option` is what names the folder, for messages.

    Raises InputError if config.yaml is missing, damaged, or of another kind of run.
    """
    path = folder / "config.yaml"
    try:
        with path.open("rb") as file:
            given = file.read(LARGEST + 1)
        if len(given) > LARGEST:
            raise ValueError(f"it is larger than {LARGEST} bytes")
        _refuse_what_grows(text := given.decode())
        return OmegaConf.to_object(OmegaConf.merge(schema, OmegaConf.load(io.StringIO(text))))  # type: ignore[return-value]
    except OSError as error:
        reason = error.strerror or "it holds no options"
        raise InputError(f"{option}: {path} cannot be read ({reason}); expected the folder of a training run") from None
    except OmegaConfBaseException as error:
        reason = misfit(error, schema)
    except (yaml.YAMLError, ValueError, TypeError) as error:  # also for what is out of range
        reason = " ".join(str(error).split())
    raise InputError(
        f"{option}: {path} is damaged, or of another kind of run or version ({reason}); expected it as a training "
        "wrote it"
    )


def _refuse_what_grows(text: str) -> None:
    """Raise ValueError for YAML that is too deep, or has anchors or interpolations, which may expand."""
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
