"""The table of a training goes on from whatever is in its file."""

from __future__ import annotations

import random
import tracemalloc
from dataclasses import dataclass
from pathlib import Path

import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from layoutrl import InputError
from layoutrl.runs.monitor import Board, metrics, reported
from tests.test_fuzz import answered, mutated_bytes, times

HEADER = ["updates", "loss", "iou_train"]
LINES = ["updates,loss,iou_train", *(f"{10 * k},{1 / k},{k / 10 if k % 2 else ''}" for k in range(1, 8))]
WHOLE = "\r\n".join([*LINES, ""]).encode()


def gone_on(file: Path, made: int) -> int:
    """The updates of the last row that is kept; a row follows."""
    with metrics(file, HEADER, made) as (rows, before):
        rows.writerow({"updates": made + 10, "loss": 0.5})
    return before


def read(file: Path) -> list[str]:
    return file.read_bytes().decode().replace("\r\n", "\n").split("\n")


def test_a_table_goes_on_after_the_updates_that_are_made(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "metrics.csv"
    for made, last in ((45, 40), (70, 70), (100, 70)):
        file.write_bytes(WHOLE)
        assert gone_on(file, made) == last
        assert read(file) == [*LINES[: 1 + last // 10], f"{made + 10},0.5,", ""]
    assert gone_on(file, 0) == 0  # a run that begins anew
    assert read(file) == [LINES[0], "10,0.5,", ""]
    assert not capsys.readouterr().out


@pytest.mark.parametrize(
    ("damage", "line"),
    [
        (WHOLE + b"\0" * 4096, 9),  # as a power cut leaves it
        (WHOLE[:-2], 8),  # its last row may have lost a digit
        (WHOLE[:-20], 8),
        (WHOLE[:-30], 7),
        (WHOLE.replace(b"\r\n40,", b"\r\ngarbage\r\n40,"), 5),
        (WHOLE.replace(b"\r\n40,", b"\r\n40,1,2,3,"), 5),
        (WHOLE.replace(b"\r\n40,", b"\r\n20,"), 5),
        (WHOLE.replace(b"\r\n40,", b"\r\n-40,"), 5),
        (WHOLE.replace(b"\r\n40,", b"\r\n999999,1,2,3\r\n40,"), 5),  # of no later update: of none
        (WHOLE.replace(b"0.25,", b"x,"), 5),
        (WHOLE.replace(b"iou_train", b"iou"), 1),
        (b"", 1),
        (bytes(range(256)) * 40, 1),
        (b"x" * 10**6, 1),
    ],
)
def test_a_damaged_table_is_cut_where_it_is_damaged(
    damage: bytes, line: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "metrics.csv"
    file.write_bytes(damage)
    assert gone_on(file, 80) == 10 * max(0, line - 2)
    assert read(file) == [*LINES[: max(1, line - 1)], "90,0.5,", ""]
    assert capsys.readouterr().out == f"{file} is damaged in line {line}; what it says from there on is left out\n"


@dataclass
class Report:
    updates: int
    loss: dict[str, float]
    episode_iou: float = 1.0


class Reports(list[Report]):
    updates = 0


def test_reports_and_evaluations_are_shown_when_they_are_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "config.yaml").write_text("seed: 0")
    reports = Reports(Report(k, {"a": 1 / k}) for k in (2, 4, 6, 8, 9))

    def look(_: Board, made: int) -> dict[str, float]:
        return {"iou/train": made / 10, "iou/held_out": 0.5, "lattice_ceiling/held_out": 1}

    assert list(reported(reports, ["updates", "loss/a"], look, tmp_path, 9, 2)) == [0.4, 0.8, 0.9]
    assert (tmp_path / "metrics.csv").read_text().split() == [
        "updates,loss_a,iou_train,iou_held_out", "2,0.5,,", "4,0.25,0.4,0.5",
        f"6,{1 / 6},,", "8,0.125,0.8,0.5", f"9,{1 / 9},0.9,0.5",
    ]  # fmt: skip
    first, *_, last = [bar for bar in capsys.readouterr().err.split("\r") if "loss/a=" in bar]
    assert "loss/a=0.5]" in first
    assert "loss/a=0.111, held_out=0.5, ceiling=1]" in last
    board = EventAccumulator(str(tmp_path)).Reload()
    assert [(event.step, event.value) for event in board.Scalars("iou/held_out")] == [(4, 0.5), (8, 0.5), (9, 0.5)]
    assert [event.step for event in board.Scalars("loss/a")] == [2, 4, 6, 8, 9]


def test_a_training_goes_on_where_nobody_reads_its_progress(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "config.yaml").write_text("seed: 0")
    monkeypatch.setattr("sys.stderr", None)  # so Python has it where it is closed
    reports = Reports([Report(9, {"a": 0.1})])
    assert list(reported(reports, ["updates", "loss/a"], lambda *_: {"iou/train": 0.5}, tmp_path, 9, 1)) == [0.5]


def test_what_no_episode_has_told_yet_is_an_empty_cell(tmp_path: Path) -> None:
    (tmp_path / "config.yaml").write_text("seed: 0")
    reports = Reports([Report(2, {"a": 0.1}, episode_iou=float("nan")), Report(4, {"a": 0.1}, episode_iou=0.5)])
    columns = ["updates", "loss/a", "episode_iou"]
    assert len(list(reported(reports, columns, lambda *_: {"iou/train": 0.5}, tmp_path, 4, 1))) == 1
    lines = (tmp_path / "metrics.csv").read_text().split()
    assert lines == ["updates,loss_a,episode_iou,iou_train,iou_held_out", "2,0.1,,,", "4,0.1,0.5,0.5,"]


def test_a_loss_that_is_no_number_is_refused(tmp_path: Path) -> None:
    (tmp_path / "config.yaml").write_text("seed: 0")
    reports = Reports([Report(2, {"a": 0.1}), Report(4, {"a": float("inf")})])
    with pytest.raises(InputError, match="the loss/a is inf after 4 updates; expected a number: begin another run"):
        list(reported(reports, ["updates", "loss/a"], lambda *_: {}, tmp_path, 9, 1))


@times(200, 10_000)
def test_whatever_the_table_holds_the_run_goes_on(count: int, tmp_path: Path) -> None:
    dice, file = random.Random(count), tmp_path / "metrics.csv"
    for _ in range(count):
        content = mutated_bytes(WHOLE, dice)
        file.write_bytes(content)
        last = answered(lambda: gone_on(file, 80), (), content)
        header, *rows, mine, end = read(file)
        assert (header, mine, end) == (LINES[0], "90,0.5,", "")
        updates = [int(row.split(",")[0]) for row in rows]
        assert [0, *updates][-1] == last <= 80
        assert updates == sorted(set(updates))


def test_a_huge_table_takes_no_memory(tmp_path: Path) -> None:
    file = tmp_path / "metrics.csv"
    with file.open("wb") as table:
        table.write(WHOLE)
        table.truncate(2**26)  # NULs, and no end of a line
    tracemalloc.start()
    assert gone_on(file, 80) == 70
    assert tracemalloc.get_traced_memory()[1] < 2**20
    tracemalloc.stop()
