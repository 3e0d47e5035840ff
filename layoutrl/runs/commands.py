"""What a command line means: composed by Hydra, checked, and whatever is wrong with it answered in one line."""

from __future__ import annotations

import difflib
import os
import re
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import is_dataclass
from typing import Any, get_type_hints

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException

from layoutrl import InputError
from layoutrl.runs.config import config_directory, register
from layoutrl.runs.resume import Stopped

INCOMPLETE = 2  # the exit status of a command that has done its work, but not all that was asked
FULL_ERROR = "HYDRA_FULL_ERROR"  # the environment variable by which Hydra raises what it would print


class Incomplete(InputError):
    """What could be done is done, and what could not has been said."""


def command(name: str, schema: type, run: Callable[[Any], object], *, sweeps: bool = False) -> Callable[[], None]:
    """The entry point of `python -m layoutrl.<name>`: calls `run` with what conf/<name>.yaml and the arguments say.

    `sweeps`: conf/<name>.yaml makes a sweep of it, also without -m.
    """
    register()

    @hydra.main(version_base="1.3", config_path=str(config_directory()), config_name=name)
    def job(config: DictConfig) -> None:
        if HydraConfig.get().mode != RunMode.MULTIRUN:
            with answers_errors():  # here: what Hydra were to see raised, it would say something about
                run(checked(config, schema))
            return
        try:
            run(checked(config, schema))
        except (InputError, OmegaConfBaseException, OSError) as error:
            said = f"error: {' '.join(HydraConfig.get().overrides.task)}: {in_a_line(error)}"
            if isinstance(error, Stopped):
                sys.exit(said)  # and with it the sweep
            print(said, file=sys.stderr)  # the other jobs shall not suffer
            if isinstance(error, Incomplete):
                raise
            raise InputError("a job of the sweep failed, as is said above") from None

    def main() -> None:
        if signal.getsignal(signal.SIGINT) == signal.SIG_DFL:  # as layoutrl has it while modules are imported
            signal.signal(signal.SIGINT, signal.default_int_handler)
        with answers_errors(), raised_errors():
            sys.argv[1:] = as_written(sys.argv[1:], schema, sweeps=sweeps)
            try:
                job()
            except HydraException as error:
                raise InputError(explained(error, schema)) from None

    return main


@contextmanager
def answers_errors() -> Iterator[None]:
    """Answer what the user can mend in one line, without a traceback."""
    try:
        yield
    except Incomplete as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(INCOMPLETE)
    except (InputError, OmegaConfBaseException, OSError) as error:
        sys.exit(f"error: {in_a_line(error)}")
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(128 + signal.SIGINT)


@contextmanager
def raised_errors() -> Iterator[None]:
    """Let Hydra raise what is wrong with a command line, instead of printing it over several lines."""
    before = os.environ.get(FULL_ERROR)
    os.environ[FULL_ERROR] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[FULL_ERROR]
        else:
            os.environ[FULL_ERROR] = before


def in_a_line(error: Exception) -> str:
    """What is wrong, as one line."""
    if isinstance(error, OSError):  # a full disk, no permission
        return f"{error.filename or 'a file'}: {error.strerror}; expected to be able to read or write it"
    if isinstance(error, OmegaConfBaseException):
        return f"{error.full_key}: {str(error).splitlines()[0]}"
    return str(error)


def checked(config: DictConfig, schema: type) -> Any:
    """The configuration as objects. Raises InputError for what is unknown in it, missing, or out of range."""
    for key in unknown_keys(config, schema):
        raise InputError(f"{key}: unknown; {nearest(key, [*options(schema)])}")
    for key in sorted(OmegaConf.missing_keys(config)):
        raise InputError(f"{key}: expected a value, as {key}=<{key}>; --help shows all options")
    return OmegaConf.to_object(config)


def options(schema: type, prefix: str = "") -> dict[str, Any]:
    """The types of all options, by their dotted names."""
    found: dict[str, Any] = {}
    for name, kind in get_type_hints(schema).items():
        found |= options(kind, f"{prefix}{name}.") if is_dataclass(kind) else {prefix + name: kind}  # type: ignore[arg-type]
    return found


def unknown_keys(config: DictConfig, schema: type, prefix: str = "") -> Iterator[str]:
    """The dotted names that were added to a configuration (as `+name=value`) and that its schema does not have."""
    kinds = get_type_hints(schema)
    for name in map(str, config):
        if name not in kinds:
            yield prefix + name
        elif is_dataclass(kinds[name]) and not OmegaConf.is_missing(config, name):
            yield from unknown_keys(config[name], kinds[name], f"{prefix}{name}.")


def nearest(key: str, known: list[str]) -> str:
    """Which known option a wrong name may mean: one that it abbreviates, or one that is spelled much like it."""

    def likeness(option: str) -> tuple[bool, bool, float]:
        (group, _, name), (its_group, _, its_name) = key.rpartition("."), option.rpartition(".")
        letters = iter(its_name)
        abbreviated = all(letter in letters for letter in name)  # in this order
        return group == its_group, abbreviated, difflib.SequenceMatcher(None, key, option).ratio()

    return f"expected the name of an option, of which {max(known, key=likeness)} is nearest"


def explained(error: HydraException, schema: type) -> str:
    """What Hydra finds wrong with a command line, as one line."""
    text = str(error)
    if found := re.search(r"Could not find '(.+)/([^']+)'", text):
        offered = re.findall(r"^\t(\S+)$", text, re.MULTILINE)
        return f"{found[1]}: expected one of {', '.join(offered)}; got {found[2]}"
    if isinstance(error.__cause__, ConfigAttributeError | ConfigKeyError) and (
        found := re.match(r"Could not (?:override|append to|find) '([^']+)'", text)
    ):
        return f"{found[1]}: unknown; {nearest(found[1], [*options(schema)])}"
    lines = [line.strip() for line in text.splitlines() if line.strip() and not line.startswith("See https")]
    if isinstance(error.__cause__, OmegaConfBaseException):
        lines.append(str(error.__cause__).splitlines()[0])
    return "; ".join(line.rstrip(".") for line in lines)


def as_written(arguments: list[str], schema: type, *, sweeps: bool = False) -> list[str]:
    """The arguments, those of text quoted, so that Hydra's grammar reads no number, list or blank into them.

    In a sweep commas part values; a comma within a text is quoted by the user there.
    """
    texts = {name for name, kind in options(schema).items() if kind in (str, str | None)}
    sweeps = sweeps or not {"-m", "--multirun"}.isdisjoint(arguments)

    def quoted(argument: str) -> str:
        key, equals, value = argument.partition("=")
        plain = key in texts and equals and value != "null" and value[:1] not in ("'", '"') and "${" not in value
        if not plain or (sweeps and re.search(r"[,()]", value)):
            return argument
        # A backslash escapes only a quote, or one that stands before a quote.
        escaped = re.sub(r"(\\*)('|$)", lambda found: 2 * found[1] + ("\\'" if found[2] else ""), value)
        return f"{key}='{escaped}'"

    return [quoted(argument) for argument in arguments]
