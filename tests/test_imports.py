"""Imports go one way between the rooms of the package, as README says."""

from __future__ import annotations

import ast
import json
from pathlib import Path

import layoutrl
from tests.commands import fresh

PACKAGE = Path(layoutrl.__file__).parent
ORDER = ("rooms", "env", "figures", "agents", "evaluation", "rivals", "runs")  # above them all what a user starts


def height(folder: str) -> int:
    return ORDER.index(folder) if folder in ORDER else len(ORDER)


def test_nothing_imports_what_stands_above_it() -> None:
    wrong = []
    for file in PACKAGE.rglob("*.py"):
        path = file.relative_to(PACKAGE)
        if len(path.parts) == 1:
            continue
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):  # of `from layoutrl import rooms` the name says what is imported
                modules += [f"{node.module}.{alias.name}" for alias in node.names]
            for module in [module for module in modules if module.startswith("layoutrl.")]:
                imported = module.split(".")[1]
                if not (PACKAGE / imported).is_dir() and not (PACKAGE / f"{imported}.py").exists():
                    continue  # what __init__.py itself holds, as InputError
                if imported != path.parts[0] and len(ORDER) > height(path.parts[0]) <= height(imported):
                    wrong.append(f"{path} imports {module}")
    assert not wrong


def test_the_order_of_imports_is_the_one_that_the_pages_state() -> None:
    for page in ("README.md", "CONTRIBUTING.md"):
        text = (PACKAGE.parent / page).read_text(encoding="utf-8")
        assert f"Imports go one way: {' <- '.join(ORDER)} <- commands." in text


def test_the_top_of_the_package_holds_what_a_user_starts() -> None:
    started = {"bench", "evaluate", "gallery", "place", "train", "watch"}
    assert {file.stem for file in PACKAGE.glob("*.py")} - {"__init__", "__main__"} == started


def test_a_wrong_option_or_file_is_answered_and_help_given_before_torch_is_imported(tmp_path: Path) -> None:
    code = """
import sys
from runpy import run_module

for command, argument in (
    ("place", "--help"), ("place", "sed=1"), ("place", "rooms=broken.sh3d"), ("place", "rooms=broken.json"),
    ("evaluate", "sed=1"), ("watch", "sed=1"), ("gallery", "data.seed=-1"), ("train", "sed=1"),
    ("planit.train", "sed=1"), ("bench", "sed=1"), ("demo", "sed=1"),
):
    sys.argv = [command, argument]
    try:
        run_module(f"layoutrl.{command}", run_name="__main__", alter_sys=True)
    except SystemExit as ended:
        print("ended", ended)
    assert "torch" not in sys.modules, (command, argument)
"""
    (tmp_path / "broken.sh3d").write_bytes(b"PK\3\4 and no more")
    (tmp_path / "broken.json").write_text("{")
    done = fresh("-c", code, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("--cfg job lists every option") == 1
    assert done.stdout.count("ended error: ") == 10


def test_an_agent_is_asked_without_torchs_compiler(tmp_path: Path) -> None:
    """It takes longer to load than a room to furnish, and only an optimiser needs it."""
    file = tmp_path / "room.jsonl"
    room = {"id": "a", "room_type": "bedroom", "outline": [[0, 0], [4, 0], [4, 3], [0, 3]], "doors": [], "windows": []}
    file.write_text(json.dumps(room | {"furniture": [{"category": "bed", "size": [2.0, 1.5]}]}))
    code = (
        "import sys, layoutrl.place\n"
        f"sys.argv = ['place', 'rooms={file}', 'device=cpu']\n"
        "layoutrl.place.main()\n"
        "print(*{'torch._dynamo', 'matplotlib'} & sys.modules.keys())"
    )
    done = fresh("-c", code, cwd=tmp_path)
    assert "1 of 1 placed" in done.stdout, done.stderr
    assert done.stdout.splitlines()[-1] == ""


def test_rooms_and_the_reference_simulator_load_no_torch(tmp_path: Path) -> None:
    code = (
        "import sys, layoutrl.rooms.sources.designer_cache, layoutrl.env.simulator\n"
        "print(*{'torch', 'scipy', 'matplotlib', 'PIL', 'hydra'} & sys.modules.keys())"
    )
    done = fresh("-c", code, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []
