"""A long training under watch: its memory and its folder are measured, 300 times at most.

    python experiments/soak.py [--minutes 30] [--runs runs/soak] [options of layoutrl.train]

Trains until the time is over, then stops the training as a user would, and says how much its memory and its files grew
after the first tenth of the time. Writes soak.csv, soak.png and soak.svg into the folder --runs.
"""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from kept import parser_of
from matplotlib import style
from matplotlib.figure import Figure

from layoutrl import InputError
from layoutrl.figures import STYLE, save
from layoutrl.runs.commands import answers_errors
from layoutrl.runs.machine import resident_bytes
from layoutrl.runs.ranges import within

UPDATES = 10**7  # more than there is time for


def watched(
    command: list[str], folder: Path, minutes: float, seconds: float
) -> list[tuple[float, float, float, float]]:
    """Run a command for `minutes`; return (minutes, MB of memory, of checkpoints, of other files) every `seconds`.

    Raises InputError if the system does not tell how much memory a process has, and if the command ends too early.
    """
    seen, began = [], time.monotonic()
    if resident_bytes(os.getpid()) is None:
        raise InputError("soak: expected Linux, which says how much memory a process has")
    with (
        (folder / "soak.log").open("w", encoding="utf-8") as log,
        subprocess.Popen(command, stdout=log, stderr=log) as process,
    ):
        while (passed := (time.monotonic() - began) / 60) < minutes and process.poll() is None:
            files = [(file, file.stat().st_size / 1e6) for file in folder.rglob("*") if file.is_file()]
            saved = sum(size for file, size in files if file.parent.name == "checkpoints")
            memory = (resident_bytes(process.pid) or float("nan")) / 1e6
            seen.append((passed, memory, saved, sum(size for _, size in files) - saved))
            time.sleep(seconds)
        if process.poll() is not None:
            raise InputError(f"soak: the training ended after {passed:.1f} minutes; {folder / 'soak.log'} says why")
        process.send_signal(signal.SIGTERM)
    return seen


@answers_errors()
def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("--minutes", type=float, default=30)
    parser.add_argument("--runs", type=Path, default=Path("runs/soak"))
    options, overrides = parser.parse_known_args()
    within("--minutes", options.minutes, options.minutes > 0, "more than 0")
    runs = options.runs.expanduser()
    runs.mkdir(parents=True, exist_ok=True)
    often = ["budget.reports=10000", "budget.evaluations=10000"]  # often enough, though UPDATES is so large
    given = [f"runs={runs}", f"method.updates.default={UPDATES}", *often]
    command = [sys.executable, "-m", "layoutrl.train", *given, *overrides]
    seen = watched(command, runs, options.minutes, seconds=max(1.0, options.minutes / 5))
    with (runs / "soak.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([("minutes", "memory_mb", "checkpoints_mb", "other_files_mb"), *seen])
    minutes, memory, saved, other = np.array(seen).T
    settled = (minutes > minutes[-1] / 10) | (minutes == minutes[-1])  # the last, where it is the only one
    for name, values in (("memory", memory), ("checkpoints", saved), ("other files", other)):
        first, last = values[settled][[0, -1]]
        print(f"{name}: {first:.1f} MB after {minutes[settled][0]:.1f} minutes, {last:.1f} MB at the end")
    with style.context(STYLE):
        figure = Figure(figsize=(4.5, 2.6))
        axes = figure.subplots()
        for label, values in (("memory", memory), ("checkpoints", saved), ("logs and pictures", other)):
            axes.plot(minutes, values, label=label)
        axes.set(xlabel="minutes", ylabel="MB", xlim=(0, None), ylim=(0, None))
        axes.legend()
        for file in save(figure, runs / "soak", option="--runs"):
            print(f"wrote {file}")


if __name__ == "__main__":
    main()
