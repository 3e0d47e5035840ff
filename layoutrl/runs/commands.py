"""Command lines: composed by Hydra and checked; whatever is wrong with one is answered in one line.

This module loads no torch: a command that imports torch only in its `run` answers a wrong option at once.
"""

from __future__ import annotations

import difflib
import errno
import os
import re
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import is_dataclass
from typing import Any, get_type_hints

import hydra
import yaml
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException, OverrideParseException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException

from layoutrl import InputError, __version__
from layoutrl.runs.config import config_directory, register
from layoutrl.runs.wording import misfit, options

INCOMPLETE = 2  # the exit status of a command that has done its work, but not all that was asked
BROKEN_PIPE = 141  # the exit status after a broken pipe, as in shells
ALIKE = 0.65  # 0 to 1: names less similar than this are not suggested
OF_MEMORY = "can't allocate memory", "out of memory", "ALLOC_FAILED"  # as torch says it of the CPU, GPUs and cuBLAS
AGAIN = "make the same sweep again to go on with it"
FULL_ERROR = "HYDRA_FULL_ERROR"  # the environment variable that makes Hydra raise errors instead of printing them


class Stopped(InputError):
    """The user stopped a run, which is saved. Arguments: a message, and the command that resumes the run."""

    def __str__(self) -> str:
        return "; go on with: ".join(self.args)


class Incomplete(InputError):
    """The command did what it could; what it could not do has been printed before."""


def command(name: str, schema: type, run: Callable[[Any], object], *, sweeps: bool = False) -> Callable[[], None]:
    """Return the entry point of `python -m layoutrl.<name>`, which calls `run` with an object of `schema`.

    The object holds the options of conf/<name>.yaml, changed by the arguments. `sweeps`: conf/<name>.yaml makes it a
    sweep even without -m.
    """
    register()
    known = [*groups(name), *options(schema)]
    goes_on = sweeps or "resume" in options(schema)  # a sweep that is repeated skips finished runs

    @hydra.main(version_base="1.3", config_path=str(config_directory()), config_name=name)
    def job(config: DictConfig) -> None:
        if HydraConfig.get().mode != RunMode.MULTIRUN:
            with answers_errors():  # here, as Hydra would print something about any error that it sees
                run(checked(config, schema, known))
            return
        try:
            run(checked(config, schema, known))
        except Exception as error:
            if not mendable(error):
                raise
            given = " ".join(HydraConfig.get().overrides.task)
            where = f"error: {given}: " if given else "error: "
            if isinstance(error, Stopped):
                sys.exit(f"{where}{error.args[0]}; {AGAIN}")  # ends the whole sweep
            print(where + in_a_line(error), file=sys.stderr)  # the other jobs go on
            if isinstance(error, Incomplete):
                raise
            raise InputError("a job of the sweep failed, as is said above") from None

    def main() -> None:
        if signal.getsignal(signal.SIGINT) == signal.SIG_DFL:  # set by layoutrl/__init__.py during imports
            signal.signal(signal.SIGINT, signal.default_int_handler)
        with answers_errors(again=goes_on and (sweeps or is_sweep(sys.argv))), raised_errors():
            if not {"-h", "--help"}.isdisjoint(sys.argv[1:]):
                print(explanation(name))
                return
            if "--version" in sys.argv[1:]:  # Hydra would print its own
                print(f"layoutrl {__version__}")
                return
            check_flags(sys.argv, groups(name))
            sys.argv[1:] = as_written(sys.argv[1:], schema, sweeps=sweeps)
            try:
                job()
            except HydraException as error:
                raise InputError(explained(error, schema, known)) from None

    return main


def explanation(name: str) -> str:
    """Return the text of --help: conf/<name>.yaml without its sections for Hydra, and the files in its groups."""
    lines, shown = [], True
    for line in (config_directory() / f"{name}.yaml").read_text(encoding="utf-8").splitlines():
        if line[:1].strip():  # not indented
            shown = not line.startswith(("defaults:", "hydra:"))
        if shown or not line:
            lines.append(line)
    offered = {group: files_of(group) for group in groups(name)}
    return "\n".join([
        "\n".join(lines).strip(),
        "",
        *(f"{group}=<one of {', '.join(files)}>" for group, files in offered.items()),
        "--cfg job lists every option and its value, those of groups (<group>.<option>) too",
    ])  # fmt: skip


@contextmanager
def answers_errors(*, again: bool = False) -> Iterator[None]:
    """Exit with one line and no traceback for an error that the user can mend, and for Ctrl-C.

    `again`: the line for Ctrl-C says that the same sweep goes on if it is repeated.
    """
    try:
        yield
        if sys.stdout:  # None where it is closed
            sys.stdout.flush()
    except Incomplete as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(INCOMPLETE)
    except KeyboardInterrupt:
        print(f"interrupted; {AGAIN}" if again else "interrupted", file=sys.stderr)
        sys.exit(128 + signal.SIGINT)
    except Exception as error:
        if not mendable(error):
            raise
        if isinstance(error, BrokenPipeError) and silence_if_unread():
            sys.exit(BROKEN_PIPE)
        sys.exit(f"error: {in_a_line(error)}")


def mendable(error: Exception) -> bool:
    """Whether the user can do something about an error; any other is a bug."""
    return isinstance(error, InputError | OmegaConfBaseException | OSError) or out_of_memory(error)


def out_of_memory(error: Exception) -> bool:
    """Whether an error means too little memory, of the machine or a GPU. torch raises RuntimeError, or a subclass."""
    if isinstance(error, RuntimeError):
        return any(words in str(error) for words in OF_MEMORY)
    return isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno == errno.ENOMEM)


def silence_if_unread() -> bool:
    """Send the rest of standard output to os.devnull if nobody reads it any more, as with `| head`.

    Returns whether that is so; to find out, a newline is printed.
    """
    try:
        print(flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # else Python tries again when it exits
        return True
    return False


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
    if isinstance(error, OmegaConfBaseException):
        return f"{error.full_key}: {str(error).splitlines()[0]}"
    if out_of_memory(error):
        return (
            "memory: there is too little of it; expected less to keep there at once: fewer rooms or, of a training, a "
            "smaller method.replay_capacity, method.batch, method.episodes, method.evaluation_moves or method.climbs"
        )
    if isinstance(error, OSError):  # a full disk, no permission
        return f"{error.filename or 'a file'}: {error.strerror or error}; expected to be able to read or write it"
    return str(error)


def checked(config: DictConfig, schema: type, known: list[str]) -> Any:
    """The configuration as objects. Raises InputError for what is unknown in it, missing, or out of range."""
    for key in unknown_keys(config, schema):
        raise InputError(f"{key}: unknown; {nearest(key, known)}")
    for key in sorted(OmegaConf.missing_keys(config)):
        raise InputError(f"{key}: expected a value; write {key}=<value>; --help shows all options")
    return OmegaConf.to_object(config)


def groups(name: str) -> list[str]:
    """Return the config groups, folders of conf/, of which conf/<name>.yaml takes a file: room, method, ..."""
    text = (config_directory() / f"{name}.yaml").read_text(encoding="utf-8")
    entries = [entry for entry in yaml.safe_load(text)["defaults"] if isinstance(entry, dict)]
    names = [key.split()[-1] for entry in entries for key in entry]  # of "optional data", data
    return [group for group in names if group.isidentifier()]  # Hydra's own are paths


def unknown_keys(config: DictConfig, schema: type, prefix: str = "") -> Iterator[str]:
    """The dotted names that were added to a configuration (as `+name=value`) and that its schema does not have."""
    kinds = get_type_hints(schema)
    for name in map(str, config):
        if name not in kinds:
            yield prefix + name
        elif is_dataclass(kinds[name]) and not OmegaConf.is_missing(config, name):
            yield from unknown_keys(config[name], kinds[name], f"{prefix}{name}.")


def nearest(key: str, known: list[str]) -> str:
    """Return a hint at the known option that a wrong name may mean: by its last part, which may be shortened."""
    name = key.rpartition(".")[2]

    def likeness(option: str) -> tuple[float, float]:
        its_name = option.rpartition(".")[2]
        initials = "".join(word[:1] for word in its_name.split("_"))
        shortened = (len(name) > 2 and name in its_name) or (len(name) > 1 and name == initials)
        alike = 0.9 if shortened else difflib.SequenceMatcher(None, name, its_name).ratio()
        return alike, difflib.SequenceMatcher(None, key, option).ratio()

    best = max(known, key=likeness)
    hint = f", of which {best} is nearest" if likeness(best)[0] >= ALIKE else ""
    return f"expected the name of an option{hint}; --help shows all options"


def explained(error: HydraException, schema: type, known: list[str]) -> str:
    """What Hydra finds wrong with a command line, as one line."""
    text, cause = str(error), error.__cause__
    if isinstance(error, OverrideParseException):
        closed = ", with its brackets and quotes closed" if "=" in error.override else ""
        return f"{error.override}: expected <option>=<value>{closed}; --help shows all options"
    if found := re.match(r"Ambiguous value for argument '([^=]+)=(.*)'", text):
        return f"{found[1]}: expected one value; got {found[2]}; add -m to try several"
    if found := re.match(r"Multiple values for (\S+)\.", text):
        return f"{found[1]}: has a value already; expected {found[1]}=<value>, without +"
    if found := re.search(r"Could not find '(.+)/([^']*)'", text):
        if found[1] == "hydra/launcher" and found[2].startswith(("joblib", "submitit")):
            return f"{found[1]}: {found[2]} is not installed; expected it: in the checkout, pip install '.[tables]'"
        offered = re.findall(r"^\t(\S+)$", text, re.MULTILINE)
        return f"{found[1]}: expected one of {', '.join(offered)}; got {found[2] or 'nothing'}"
    unknown = isinstance(cause, ConfigAttributeError | ConfigKeyError) or "No match in the defaults list" in text
    if unknown and (found := re.match(r"Could not (?:override|append to|find) '([^']+)'", text)):
        return f"{found[1]}: unknown; {nearest(found[1], known)}"
    if isinstance(cause, OmegaConfBaseException) and (
        found := re.match(r"Error merging override [^=]+=(.*)", text, re.DOTALL)
    ):
        return f"{misfit(cause, schema)}; got {found[1] or 'nothing'}"
    lines = [line.strip() for line in text.splitlines() if line.strip() and not line.startswith("See https")]
    if isinstance(cause, OmegaConfBaseException):
        lines.append(str(cause).splitlines()[0])
    return "; ".join(line.rstrip(".") for line in lines)


def check_flags(arguments: list[str], of_files: Sequence[str]) -> None:
    """Raise InputError for what Hydra would answer with a traceback."""
    shows = any(argument.startswith(("-c", "--cfg")) for argument in arguments)
    if is_sweep(arguments) and shows:
        raise InputError("--cfg: it shows the options of one run; expected no -m beside it")
    if "--resolve" in arguments and not shows:
        raise InputError("--resolve: it is of --cfg, which shows options; expected --cfg job beside it")
    if any(argument.startswith("--experimental-rerun") for argument in arguments):
        raise InputError("--experimental-rerun: Hydra's, which runs of layoutrl do not have; expected other options")
    for argument in arguments:
        group, _, names = argument.lstrip("+").partition("=")
        if group.split("@")[0] not in of_files:
            continue
        if "null" in names.strip("[]").casefold().split(","):
            raise InputError(f"{group}: expected the name of one; --help lists them; got null")
        if names.startswith("["):  # Hydra would take the last alone
            raise InputError(f"{group}: expected the name of one; got {names}; several are tried by -m and commas")


def files_of(group: str) -> list[str]:
    """Return the names of the files of a group, sorted."""
    return sorted(file.stem for file in (config_directory() / group).glob("*.yaml"))


def is_sweep(arguments: list[str]) -> bool:
    """Whether the arguments ask for a sweep."""
    return not {"-m", "--multirun"}.isdisjoint(arguments)


def as_written(arguments: list[str], schema: type, *, sweeps: bool = False) -> list[str]:
    """Return the arguments, values of text options quoted, so that Hydra reads no number, list or blank into them.

    So is the value of a group of files that names none of them. In a sweep commas separate values, and the user has to
    quote a text that contains one. Raises InputError for a value without an option, and for an option with dashes
    before it.
    """
    kinds, of_files = options(schema), {folder.name for folder in config_directory().iterdir() if folder.is_dir()}
    texts = of_files.union(name for name, kind in kinds.items() if kind in (str, str | None))
    sweeps = sweeps or is_sweep(arguments)

    def quoted(argument: str) -> str:
        if argument.startswith("="):
            raise InputError(f"{argument}: expected <option>=<value>; --help shows all options")
        key, equals, value = argument.partition("=")
        bare = key.removeprefix("--").replace("-", "_")
        is_option = bare in (kinds.keys() | of_files)
        if key.startswith("--") and is_option and (bare != "run" or equals):  # --run alone is Hydra's own
            raise InputError(f"{argument}: expected <option>=<value> without dashes, as {bare}=...")
        if key in of_files and value in files_of(key):
            return argument
        plain = key in texts and equals and value != "null" and value[:1] not in ("'", '"') and "${" not in value
        if not plain or ((sweeps or key in of_files) and re.search(r"[,()]", value)):
            return argument
        # A backslash escapes only a quote, or one that stands before a quote.
        escaped = re.sub(r"(\\*)('|$)", lambda found: 2 * found[1] + ("\\'" if found[2] else ""), value)
        return f"{key}='{escaped}'"

    # -m goes first: Hydra takes what stands before it for another kind of argument.
    return sorted(map(quoted, arguments), key=lambda argument: argument not in ("-m", "--multirun"))
