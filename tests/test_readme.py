"""What the README says works: its Python, its commands' options, its room."""

from __future__ import annotations

import json
import re
from pathlib import Path
from textwrap import dedent

import pytest

from layoutrl.config import composed
from layoutrl.rooms.files import parse_room

README = (Path(__file__).resolve().parents[1] / "README.md").read_text(encoding="utf-8")
BLOCKS = [dedent(block) for block in re.findall(r"(?:^    .*\n(?:\n(?=    ))?)+", README, flags=re.MULTILINE)]


def test_the_python_runs() -> None:
    programs = [block for block in BLOCKS if block.startswith("import gymnasium")]
    assert len(programs) == 2
    for code in programs:
        exec(compile(code, "README.md", "exec"), {})


def test_the_room_is_read() -> None:
    (text,) = (block for block in BLOCKS if block.startswith('{"id"'))
    assert parse_room(text).id == json.loads(text)["id"]


COMMANDS = re.findall(r"python -m layoutrl\.(\w+) (.*)", README)


@pytest.mark.parametrize(("entry_point", "options"), COMMANDS)
def test_the_commands_options_exist(entry_point: str, options: str) -> None:
    assert composed(entry_point, *(option.replace("<name>", "name") for option in options.split()))
