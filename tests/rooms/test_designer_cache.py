"""The cache of designed rooms."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from layoutrl.rooms import designer as rules
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.sources import designer_cache


@pytest.fixture(autouse=True)
def fresh_hash() -> None:
    designer_cache.rules_hash.cache_clear()


def test_a_second_start_reads_what_the_first_designed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = designer_cache.read(tmp_path / "new", "bedroom", "train", 0, 5)
    assert first.rooms == design_rooms("bedroom", "train", 0, 5).rooms
    monkeypatch.delattr(designer_cache, "design_rooms")
    assert designer_cache.read(tmp_path / "new", "bedroom", "train", 0, 5) == first


@pytest.mark.parametrize(
    "other",
    [("study", "train", 0, 5), ("bedroom", "test", 0, 5), ("bedroom", "train", 1, 5), ("bedroom", "train", 0, 6)],
)
def test_type_part_seed_and_count_have_files_of_their_own(tmp_path: Path, other: tuple) -> None:
    designer_cache.read(tmp_path, "bedroom", "train", 0, 5)
    rooms = designer_cache.read(tmp_path, *other).rooms
    assert rooms == design_rooms(*other).rooms
    assert len(list(tmp_path.iterdir())) == 2


def test_a_changed_rule_never_reads_old_rooms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = designer_cache.rules_hash()
    shutil.copytree(rules.__path__[0], tmp_path / "changed")
    monkeypatch.setattr(rules, "__path__", [str(tmp_path / "changed")])
    designer_cache.rules_hash.cache_clear()
    assert designer_cache.rules_hash() == before
    file = tmp_path / "changed" / "bedroom.py"
    file.write_text(file.read_text().replace("front=60", "front=65", 1))
    designer_cache.rules_hash.cache_clear()
    assert designer_cache.rules_hash() != before


@pytest.mark.parametrize("broken", [b"", b"\x80\x04]", b"cnowhere\nnothing\n."])
def test_a_broken_cache_file_is_made_anew(tmp_path: Path, broken: bytes) -> None:
    whole = designer_cache.read(tmp_path, "bedroom", "train", 0, 3)
    (file,) = tmp_path.iterdir()
    file.write_bytes(broken)
    assert designer_cache.read(tmp_path, "bedroom", "train", 0, 3) == whole
    assert designer_cache.read(tmp_path, "bedroom", "train", 0, 3) == whole
    assert list(tmp_path.iterdir()) == [file]


def test_a_folder_that_cannot_be_written_costs_a_line_and_no_rooms(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("in the way")
    assert len(designer_cache.read(tmp_path / "file", "bedroom", "train", 0, 3).rooms) == 3
    assert "not kept" in capsys.readouterr().out


def test_the_cache_lies_where_the_user_keeps_caches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    designer_cache.read(None, "bedroom", "train", 0, 2)
    assert len(list((tmp_path / "layoutrl").iterdir())) == 1
