"""Pictures of the demo: what is answered before a server begins."""

from __future__ import annotations

import sys
from pathlib import Path

import demo_pictures
import pytest


@pytest.fixture(autouse=True)
def nothing_is_served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(demo_pictures, "served", None)


def test_help_is_given_and_no_folder_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["demo_pictures.py", "--help"])
    with pytest.raises(SystemExit) as ended:
        demo_pictures.main()
    assert ended.value.code == 0
    assert "docs/demo.md" in capsys.readouterr().out
    assert not list(tmp_path.iterdir())


def test_without_playwright_a_line_says_what_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["demo_pictures.py"])
    monkeypatch.setitem(sys.modules, "playwright.sync_api", None)
    with pytest.raises(SystemExit, match=r"^error: playwright: expected it to be installed, as by pip install "):
        demo_pictures.main()
