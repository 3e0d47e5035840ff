"""What a run that was stopped has to have in common with the one that goes on."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from layoutrl.runs.config import PlaceConfig
from layoutrl.runs.file_placer import about


def test_a_run_goes_on_only_with_the_very_files_that_it_began_with(tmp_path: Path) -> None:
    rooms, agent = tmp_path / "rooms.jsonl", tmp_path / "run" / "checkpoints" / "1.pt"
    agent.parent.mkdir(parents=True)
    for file in (rooms, agent):
        file.write_text("{}\n")
    config = PlaceConfig(rooms=str(rooms), run=str(tmp_path / "run"))
    before = about(config, None)
    assert about(replace(config, out="o.jsonl", pictures="p", drawing="png", device="cpu"), None) == before
    for file, name in ((rooms, "rooms"), (agent, "run")):
        os.utime(file, ns=(0, 0))  # as long as before, but written anew
        now = about(config, None)
        assert [key for key in before if now[key] != before[key]] == [name]
        before = now
