"""A command line: what is wrong with it is answered in one line; texts are kept as they were written."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from hypothesis import example, given
from hypothesis import strategies as st
from omegaconf import OmegaConf

from layoutrl import InputError, __version__
from layoutrl.runs.commands import Stopped, as_written, command, explained
from layoutrl.runs.config import (
    BenchConfig,
    EvaluateConfig,
    GalleryConfig,
    PlaceConfig,
    PlanitCommand,
    TrainCommand,
    TrainConfig,
    WatchConfig,
    config_directory,
)

PROJECT = Path(__file__).resolve().parents[2]
Answer = tuple[list[Any], int | None, str]


@pytest.fixture
def ask(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    """What a command that does nothing was called with, its exit status, and what it said to standard error."""
    monkeypatch.chdir(tmp_path)

    def asked(name: str, schema: type, *arguments: str, run=None) -> Answer:
        called: list[Any] = []
        monkeypatch.setattr(sys, "argv", [name, *arguments])
        GlobalHydra.instance().clear()
        status = None
        try:
            command(name, schema, run or called.append)()
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else 1
            if isinstance(end.code, str):
                print(end.code, file=sys.stderr)  # as Python does
        return called, status, capsys.readouterr().err

    return asked


@pytest.mark.parametrize(
    ("argument", "expected"),
    [
        ("+method.lr=0.1", "method.lr: unknown; expected the name of an option, of which method.learning_rate is"),
        ("method.lr=0.1", "method.lr: unknown; expected the name of an option, of which method.learning_rate is"),
        ("+metod.slide=false", "metod: unknown; expected the name of an option, of which method is nearest; --help"),
        ("++methodd.lr=0.1", "methodd: unknown; expected the name of an option, of which method is nearest; --help"),
        ("methd=paper", "methd: unknown; expected the name of an option, of which method is nearest; --help"),
        ("rooom=study", "rooom: unknown; expected the name of an option, of which room is nearest; --help"),
        ("scop=room", "scop: unknown; expected the name of an option, of which scope is nearest; --help"),
        ("learning_rate=.1", "expected the name of an option, of which method.learning_rate is nearest; --help"),
        ("lr=.1", "expected the name of an option, of which method.learning_rate is nearest; --help"),
        ("budget.discont=.1", "expected the name of an option, of which method.discount is nearest; --help"),
        ("updates=5", "expected the name of an option, of which room.updates is nearest; --help shows all options"),
        ("gpu=1", "gpu: unknown; expected the name of an option; --help shows all options"),
        ("method.optimizer=sgd", "expected the name of an option; --help shows all options"),
        ("rom=bedroom", "rom: unknown; expected the name of an option, of which room is nearest"),
        ("sed=1", "sed: unknown; expected the name of an option, of which seed is nearest"),
        ("+data.sed=1", "data.sed: unknown; expected the name of an option, of which data.seed is nearest"),
        ("room=bedrom", "room: expected one of balcony, bathroom, bedroom, dining_room, kitchen, living_room, study"),
        (
            "room=",
            "room: expected one of balcony, bathroom, bedroom, dining_room, kitchen, living_room, study, tatami;",
        ),
        ("room=bedroom,study", "room: expected one value; got bedroom,study; add -m to try several"),
        ("room=[bedroom,study]", "room: expected the name of one; got [bedroom,study]; several are tried by -m and"),
        (
            "room=1",
            "room: expected one of balcony, bathroom, bedroom, dining_room, kitchen, living_room, study, tatami;",
        ),
        ("budget=true", "budget: expected one of default, full, scene, smoke; got true"),
        ("task=2", "task: unknown; expected the name of an option"),
        ("+room=study", "room: has a value already; expected room=<value>, without +"),
        ("seed=one", "seed: expected a whole number; got one"),
        ("seed=", "seed: expected a whole number; got nothing"),
        ("data.train_rooms=1.5", "data.train_rooms: expected a whole number; got 1.5"),
        ("method.learning_rate=x", "method.learning_rate: expected a number; got x"),
        ("method.slide=no way", "method.slide: expected true or false; got no way"),
        ("method.steps=3", "method.steps: expected a list, as [1,2]; got 3"),
        ("method.steps=[1,x]", "method.steps[1]: expected a number; got [1,x]"),
        ("method.updates.smoke=x", "method.updates.smoke: expected a whole number; got x"),
        ("method.updates=3", "method.updates: expected names with values; got 3"),
        ("seed", "seed: expected <option>=<value>; --help shows all options"),
        ("seed=[1", "seed=[1: expected <option>=<value>, with its brackets and quotes closed; --help shows all"),
        ("method.batch==", "method.batch==: expected <option>=<value>"),
        ("=3", "=3: expected <option>=<value>; --help shows all options"),
    ],
)
def test_what_is_wrong_with_a_command_line_is_answered_in_one_line(ask, argument: str, expected: str) -> None:
    called, status, said = ask("train", TrainCommand, argument)
    assert not called
    assert status == 1
    (line,) = said.splitlines()
    assert line.startswith("error: ")
    assert expected in line
    assert not re.search("Hydra|Error|EOF|DictConfig|type '", line)


def test_of_an_unknown_option_no_name_is_suggested_that_is_not_alike(ask) -> None:
    _, _, said = ask("place", PlaceConfig, "layouts=3")
    assert "layouts: unknown; expected the name of an option; --help shows all options" in said


def test_the_version_is_the_projects(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["train", "--version"])
    command("train", TrainCommand, pytest.fail)()
    assert capsys.readouterr().out == f"layoutrl {__version__}\n"


@pytest.mark.parametrize("shows", [("--cfg", "job"), ("-c", "job"), ("--cfg=job",)])
def test_the_options_of_a_sweep_are_not_shown(ask, shows: tuple[str, ...]) -> None:
    called, status, said = ask("train", TrainCommand, "-m", "seed=0,1", *shows)
    assert (called, status) == ([], 1)
    assert said == "error: --cfg: it shows the options of one run; expected no -m beside it\n"


def test_a_value_that_must_be_given_is_asked_for(ask) -> None:
    _, status, said = ask("evaluate", EvaluateConfig)
    assert status == 1
    assert said == "error: run: expected a value; write run=<value>; --help shows all options\n"


@pytest.mark.skipif(sys.platform == "win32", reason="a pipe of POSIX")
@pytest.mark.parametrize("command", ["train", "planit.train"])
def test_help_names_the_command_and_ends_quietly_when_nobody_reads_on(command: str, tmp_path: Path) -> None:
    program = [sys.executable, "-m", f"layoutrl.{command}", "--help"]
    with subprocess.Popen(
        program, cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(PROJECT)}, stdout=-1, stderr=-1, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()  # before the command has begun to print
        assert process.stderr.read() == ""
    assert process.returncode == 141
    done = subprocess.run(program, cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(PROJECT)}, capture_output=True)
    assert done.stdout.startswith(f"# python -m layoutrl.{command} ".encode())


@pytest.mark.parametrize(("scope", "name"), [("item", "room.updates"), ("room", "room.whole_updates")])
def test_a_type_of_room_that_lacks_its_updates_is_answered_by_their_name(ask, scope: str, name: str) -> None:
    called, status, said = ask("train", TrainCommand, f"scope={scope}", f"{name}=0")
    assert (called, status) == ([], 1)
    assert f"method.updates: expected 1 or more each (default: as {name} says); got " in said


@pytest.mark.parametrize("name", ["../../x", "a/b", ".", "..", "", "a\\b"])
def test_a_run_is_named_by_one_component_of_a_path(ask, name: str) -> None:
    called, status, said = ask("train", TrainCommand, f"name={name}")
    assert (called, status) == ([], 1)
    assert "name: expected the name of a folder, without / and \\; runs= says where it goes; got" in said


@example("null")
@example("'a")
@example("${x}")
@given(st.text(st.characters(codec="utf-8", exclude_characters="\n\r\0"), min_size=1))
def test_a_text_is_read_as_it_was_written(text: str) -> None:
    (argument,) = as_written([f"name={text}"], TrainCommand)
    if text[:1] in ("'", '"') or "${" in text:  # the user's own quotes, closed or not, and Hydra's interpolations
        assert argument == f"name={text}"
        return
    (override,) = OverridesParser.create().parse_overrides([argument])
    assert override.value() == (None if text == "null" else text)


def test_only_texts_are_quoted_and_a_sweep_goes_on_to_be_one() -> None:
    arguments = ["name=1e3", "seed=1e3", "data.root=my rooms", "room=bedroom", "+name=x", "out", "name=null"]
    expected = ["name='1e3'", "seed=1e3", "data.root='my rooms'", "room=bedroom", "+name=x", "out", "name=null"]
    assert as_written(arguments, TrainCommand) == expected
    assert as_written(["-m", "name=a,b", "name=a b"], TrainCommand) == ["-m", "name=a,b", "name='a b'"]
    assert as_written(["seed=0", "-m", "fold=0,1"], TrainCommand) == ["-m", "seed=0", "fold=0,1"]
    assert as_written(["name=a,b", "name=a b"], TrainCommand, sweeps=True) == ["name=a,b", "name='a b'"]


@pytest.mark.parametrize(
    ("argument", "meant", "schema"),
    [
        ("--name", "name", TrainCommand),
        ("--seed=3", "seed", TrainCommand),
        ("--room=bedroom", "room", TrainCommand),
        ("--data.root", "data.root", TrainCommand),
        ("--run=runs/x", "run", EvaluateConfig),
    ],
)
def test_an_option_with_dashes_is_told_how_it_is_written(argument: str, meant: str, schema: type) -> None:
    with pytest.raises(InputError, match=f"^{argument}: expected <option>=<value> without dashes, as {meant}="):
        as_written([argument, "x"], schema)
    assert as_written(["--cfg", "job"], TrainCommand) == ["--cfg", "job"]


def test_texts_arrive_as_they_were_written(ask) -> None:
    (config,), status, _ = ask("train", TrainCommand, "name=1e3", "data.root=my rooms/[a], b=c", "runs='quoted'")
    assert status is None
    assert (config.name, config.data.root, config.runs) == ("1e3", "my rooms/[a], b=c", "quoted")


@pytest.mark.parametrize(
    ("name", "schema", "options"),
    [
        ("train", TrainCommand, ["runs", "resume"]),
        ("planit", PlanitCommand, ["runs", "resume"]),
        ("evaluate", EvaluateConfig, ["run", "out"]),
        ("watch", WatchConfig, ["run", "out"]),
        ("gallery", GalleryConfig, ["out"]),
        ("bench", BenchConfig, ["runs"]),
    ],
)
def test_a_tilde_is_the_users_home(
    ask, name: str, schema: type, options: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    (config,), _, _ = ask(name, schema, *(f"{option}=~/my {option}" for option in options))
    assert [getattr(config, option) for option in options] == [f"{tmp_path}/my {option}" for option in options]
    (config,), _, _ = ask(name, schema, *(f"{option}=~not a user/x" for option in options))
    assert {getattr(config, option) for option in options} == {"~not a user/x"}


def test_a_job_that_is_wrong_costs_a_sweep_no_other(ask, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seeds = []
    monkeypatch.setenv("HOME", str(tmp_path))
    arguments = ("-m", "seed=1,-1,2", "runs=~/here")
    _, status, said = ask("train", TrainCommand, *arguments, run=lambda config: seeds.append(config.seed))
    assert seeds == [1, 2]
    assert status == 1
    assert "error: seed=-1 runs='~/here': seed: expected 0 or more; got -1\n" in said
    assert "Traceback" not in said
    assert [path.name for path in tmp_path.iterdir()] == ["here"]  # no multirun.yaml beside it


def test_only_a_command_that_sweeps_says_so_in_its_file() -> None:
    files = config_directory().glob("*.yaml")
    assert [file.stem for file in files if OmegaConf.select(OmegaConf.load(file), "hydra.mode")] == ["cell"]


def test_what_goes_wrong_in_a_run_is_answered_and_a_mistake_of_ours_is_raised(ask) -> None:
    def wrong(_: TrainConfig) -> None:
        raise InputError("rooms: too few")

    assert ask("train", TrainCommand, run=wrong)[1:] == (1, "error: rooms: too few\n")

    def full(_: TrainConfig) -> None:
        raise OSError(28, "No space left on device", "metrics.csv")

    assert "metrics.csv: No space left on device" in ask("train", TrainCommand, run=full)[2]

    def crowded(_: TrainConfig) -> None:
        raise RuntimeError("[enforce fail] DefaultCPUAllocator: can't allocate memory: you tried to allocate 9 bytes")

    for sweep in ((), ("-m", "seed=1,2")):
        _, status, said = ask("train", TrainCommand, *sweep, run=crowded)
        assert status == 1
        assert "memory: there is too little of it; expected less to keep there at once" in said
        assert "method.replay_capacity" in said
        assert "Traceback" not in said

    def interrupted(_: TrainConfig) -> None:
        raise KeyboardInterrupt

    assert ask("train", TrainCommand, run=interrupted)[1:] == (130, "interrupted\n")

    sweep = ask("train", TrainCommand, "-m", "seed=1,2", run=interrupted)
    assert sweep[1:] == (130, "interrupted; make the same sweep again to go on with it\n")

    def stopped(_: TrainConfig) -> None:
        raise Stopped("stopped after 3 of 9 updates", "python -m layoutrl.train resume=here")

    one = "error: stopped after 3 of 9 updates; go on with: python -m layoutrl.train resume=here\n"
    assert ask("train", TrainCommand, run=stopped)[1:] == (1, one)
    for job in ("", "seed=1: "):
        said = f"error: {job}stopped after 3 of 9 updates; make the same sweep again to go on with it\n"
        assert ask("train", TrainCommand, "-m", *job[:-2].split(), run=stopped)[1:] == (1, said)

    def broken(_: TrainConfig) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        ask("train", TrainCommand, run=broken)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT for another process")
@pytest.mark.parametrize("program", [("-m", "layoutrl.train"), ("-m", "layoutrl", "train"), ("bin/layoutrl", "train")])
def test_ctrl_c_while_modules_are_imported_leaves_no_traceback(program: tuple[str, ...], tmp_path: Path) -> None:
    """At 0.1 s or so: as the first of the modules is imported, which here presses Ctrl-C itself."""
    (tmp_path / "gymnasium.py").write_text("import signal; signal.raise_signal(signal.SIGINT)")
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin/layoutrl").write_text("from layoutrl.__main__ import main; main()")  # as pip writes it
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(PROJECT)])}
    done = subprocess.run(
        [sys.executable, *program, "sed=1"],
        cwd=tmp_path, env=environment, capture_output=True, text=True, check=False,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # else a shell's background ignores it
    )  # fmt: skip
    assert done.returncode == -signal.SIGINT
    assert done.stderr == ""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT for another process")
def test_ctrl_c_is_left_to_programs_of_others(tmp_path: Path) -> None:
    code = "import signal, layoutrl; assert signal.getsignal(signal.SIGINT) is signal.default_int_handler"
    subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": str(PROJECT)}, check=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip


def test_a_launcher_that_is_not_installed_is_answered_with_what_installs_it() -> None:
    error = HydraException("Could not find 'hydra/launcher/joblib'\n\nAvailable options in 'hydra/launcher':\n\tbasic")
    assert explained(error, TrainCommand, []) == (
        "hydra/launcher: joblib is not installed; expected it: in the checkout, pip install '.[tables]'"
    )
