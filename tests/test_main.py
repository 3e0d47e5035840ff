"""The command `layoutrl`, as an installed package has it."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

from layoutrl import __main__ as program
from layoutrl import __version__
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.documents import room_to_dict
from tests.commands import COMMANDS, PROJECT

# In the environment of the test: whatever asks for the internet fails.
OFFLINE = """import socket
def refused(self, address, connect=socket.socket.connect):
    if self.family != socket.AF_UNIX:
        raise OSError("no network")
    return connect(self, address)
socket.socket.connect = refused
"""


def called(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> None:
    monkeypatch.setattr("sys.argv", ["layoutrl", *arguments])
    program.main()


@pytest.mark.parametrize("asked", [(), ("--help",), ("help",)])
def test_alone_it_lists_every_command_in_a_line(
    asked: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    called(monkeypatch, *asked)
    listed = re.findall(r"^  ([\w.]+)  +\w.*$", capsys.readouterr().out, flags=re.MULTILINE)
    assert sorted(listed) == sorted(COMMANDS)


def test_the_version_is_told(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    called(monkeypatch, "--version")
    assert capsys.readouterr().out == f"layoutrl {__version__}\n"


@pytest.mark.parametrize(("command", "meaning"), [
    ("place", "drawing: svg     # of pictures;"),
    ("demo", "timeout: 60      # seconds"),
    ("evaluate", "data=<one of designer, designer_rooms, "),
])  # fmt: skip
def test_help_says_what_options_mean(
    command: str, meaning: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    called(monkeypatch, command, "--help")
    said = capsys.readouterr().out
    assert said.startswith(f"# python -m layoutrl.{command} ")
    assert meaning in said
    assert not {"defaults:", "hydra:", "column="} & set(re.findall(r"^\w+[:=]", said, re.MULTILINE))


def test_a_command_gets_its_options(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SystemExit, match=r"^error: rooms: expected 1 or more; got 0$"):
        called(monkeypatch, "gallery", "rooms=0")


def test_an_unknown_command_is_answered_with_the_nearest(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SystemExit, match=r"^error: plcae: expected a command, of which place is nearest; "):
        called(monkeypatch, "plcae", "rooms=mine.jsonl")


def test_a_list_of_commands_imports_none() -> None:
    code = "import sys; from layoutrl.__main__ import main; main(); sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": str(PROJECT)}).returncode == 0


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    at_hand = ["--no-build-isolation"] if find_spec("hatchling") else []
    build = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", *at_hand, "-w", str(folder), str(PROJECT)]
    done = subprocess.run(build, capture_output=True, text=True)
    if re.search(r"No matching distribution found for hatchling|Network is unreachable", done.stderr):
        pytest.skip("hatchling is neither installed nor to be had from an index")
    assert done.returncode == 0, done.stderr
    (file,) = folder.iterdir()
    return file


def test_the_wheel_holds_the_configuration_and_says_that_it_is_typed(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    conf = {f"layoutrl/{path.relative_to(PROJECT)}" for path in (PROJECT / "conf").rglob("*.yaml")}
    files = [*(PROJECT / "layoutrl").rglob("*.yaml"), *(PROJECT / "layoutrl/weights").iterdir()]
    data = {str(path.relative_to(PROJECT)) for path in files}
    assert {"layoutrl/py.typed", "layoutrl/figures/style.mplstyle"} | conf | data <= names


@pytest.mark.skipif(sys.platform == "win32", reason="scripts lie elsewhere")
def test_the_wheel_works_in_an_environment_of_its_own_from_another_directory_offline(
    wheel: Path, tmp_path: Path
) -> None:
    home, work = tmp_path / "venv", tmp_path / "work"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(home)], check=True)
    (site,) = home.glob("lib/python*/site-packages")
    others = [path for path in sys.path if path.endswith("site-packages")]  # with what the project depends on
    (site / "others.pth").write_text("\n".join(others))
    (site / "sitecustomize.py").write_text(OFFLINE)
    python = ["--python", str(home / "bin" / "python")]
    install = [sys.executable, "-m", "pip", *python, "install", "-q", "--no-deps", "--no-index", str(wheel)]
    subprocess.run(install, check=True, capture_output=True)
    work.mkdir()
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}

    def layoutrl(*arguments: str) -> str:
        command = [str(home / "bin" / "layoutrl"), *arguments]
        return subprocess.run(command, cwd=work, env=environment, check=True, capture_output=True, text=True).stdout

    assert "place " in layoutrl()
    assert "wrote gallery/balcony-designer-seed0.png" in layoutrl("gallery", "room=balcony", "rooms=1")
    brief = room_to_dict(brief_of(design_rooms("bathroom", "test", 3, 1).rooms[0]))
    (work / "rooms.jsonl").write_text(json.dumps(brief))
    count = len(brief["furniture"])
    assert f"placed {count} of {count} items in 1 room" in layoutrl("place", "rooms=rooms.jsonl", "device=cpu")
    where = "import layoutrl, pathlib; print(pathlib.Path(layoutrl.__file__).parent)"
    found = subprocess.run(
        [str(home / "bin" / "python"), "-c", where], cwd=work, env=environment, capture_output=True, text=True
    )
    assert Path(found.stdout.strip()).is_relative_to(home)
