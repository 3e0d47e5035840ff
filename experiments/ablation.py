"""What each part of the method is worth: one row a change, several seeds, on designed rooms.

    python experiments/ablation.py bedroom [--updates 4000] [--seeds 0 1 2] [--jobs 2] [--runs runs/ablation]
    python experiments/ablation.py bedroom --scope room --seeds 0

Trains with each change on its own, on rooms of the data seed that the project tunes on (1: no figure in the README is
measured there), and scores in held-out rooms (1,000; with --scope room 300). Writes
experiments/results/ablation/<type>.json or <type>-rooms.json and prints its table.
Finished runs are not trained again: after an interruption, the same command goes on. Results of another number of
updates or other seeds are not overwritten.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from kept import RESULTS, check_kept, parser_of
from printing import Table, listed

from layoutrl import InputError
from layoutrl.rooms.room import MAIN_ITEM
from layoutrl.runs.commands import answers_errors
from layoutrl.runs.config import TrainConfig, composed
from layoutrl.runs.files import write_json
from layoutrl.runs.folder import differences, folders_of, load_config, stated
from layoutrl.runs.ranges import within
from layoutrl.runs.resume import EVALUATION

KEPT = RESULTS / "ablation"
DATA_SEED = 1
ITEM = {
    "the method": [],
    "no mirrored and turned views": ["method.symmetries=false"],
    "no slides": ["method.slide=false"],
    "no steps of half a centimetre": ["method.steps=[0.32,0.08,0.02]"],
    "double Q-learning": ["method.double=true"],
    "no dueling head": ["method.dueling=false"],
    "discount 0.9": ["method.discount=0.9"],
    "episodes end at the goal": ["method.goal_iou=0.95"],
    "no climb at the end": ["method.climbs=0"],
    "not in line with what stands beside": ["method.snap=0"],
}
ROOM = {
    "the method": [],
    "a fourth term of the reward": ["reward=usable"],
    "no starts near the designer's place": ["method.near_share=0"],
    "no rooms with its own mistakes": ["method.own_share=0"],
    "no mirrored views": ["method.symmetries=false"],
    "no slides": ["method.slide=false"],
}
CHANGES = {"item": ITEM, "room": ROOM}
ALWAYS = {"item": [], "room": ["scope=room", "data.test_rooms=300"]}
COLUMNS = {
    "item": {">= 0.9": "{share_090:.1%}", "lattice ceiling": "{ceiling:.3f}", "moves": "{moves:.1f}"},
    "room": {"facing": "{facing:.3f}", "faultless": "{faultless:.3f}", "fronts free": "{fronts:.3f}"},
}


def check_as_before(room_type: str, overrides: Sequence[str], folder: Path) -> None:
    """Raise InputError if the run in `folder` was begun with other settings than `overrides` give today."""
    kept, asked = load_config(folder, TrainConfig), composed("train", f"room={room_type}", *overrides)
    if others := differences(stated(kept), stated(asked)):
        raise InputError(f"{folder} was trained with another {', '.join(others)}; expected another --runs")


def trained(room_type: str, wanted: Path, overrides: Sequence[str]) -> dict[str, Any]:
    """Return the evaluation of a run, which is trained first if it is new, and gone on with if it was begun.

    Raises InputError if the training fails.
    """
    folder, runs = begun(wanted), wanted.parents[1]
    log = runs / f"{room_type}-{wanted.name}.log"
    if not (folder and (folder / EVALUATION).exists()):
        arguments = [f"room={room_type}", f"runs={runs}", f"name={wanted.name}", *overrides]
        if folder:
            arguments = [f"resume={folder}"]
        with log.open("w", encoding="utf-8") as file:
            command = [sys.executable, "-m", "layoutrl.train", *arguments]
            environment = os.environ | {"OMP_NUM_THREADS": "1"}
            done = subprocess.run(command, env=environment, stdout=file, stderr=subprocess.STDOUT, check=False)
        folder = begun(wanted)
        if done.returncode or not folder:
            raise InputError(f"{wanted}: was not trained; {log} says why")
    return json.loads((folder / EVALUATION).read_text(encoding="utf-8"))


def begun(wanted: Path) -> Path | None:
    """Return the folder of a run, None if it was not begun.

    Its name ends in a number if an earlier attempt was killed before it had written its configuration.
    """
    return next((folder for folder in folders_of(wanted) if (folder / "config.yaml").exists()), None)


def row(evaluations: list[dict[str, Any]]) -> dict[str, Any]:
    """Return means over seeds, and the standard deviation of the IoU (None for a single seed)."""
    agents = [evaluation["rows"]["agent"] for evaluation in evaluations]
    ious = [agent["mean_iou"] for agent in agents]
    one_item = {
        "ceiling": [evaluation.get("lattice_ceiling") for evaluation in evaluations],
        "moves": [evaluation.get("moves") for evaluation in evaluations],
    }
    means = {name: [agent.get(name) for agent in agents] for name in ("share_090", "facing", "faultless", "fronts")}
    return {
        "mean_iou": statistics.mean(ious),
        "std_over_seeds": statistics.stdev(ious) if len(ious) > 1 else None,
        "iou_by_seed": ious,
    } | {name: statistics.mean(values) for name, values in (means | one_item).items() if None not in values}


def table(result: dict[str, Any]) -> Table:
    """Return the table of a results file."""
    seeds = ", ".join(map(str, result["seeds"]))
    columns = {
        "": "{change}",
        "mean IoU ± over seeds": "{mean_iou:.3f} ± {std_over_seeds:.3f}",
        **COLUMNS[result["scope"]],
    }
    title = f"What each part is worth: {result['room_type']}, {result['updates']} updates, seeds {seeds}"
    records = [{"change": change, **found} for change, found in result["rows"].items()]
    return listed("ablation", title, columns, records, [])


@answers_errors()
def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("room_type", choices=list(MAIN_ITEM))
    parser.add_argument("--scope", choices=list(CHANGES), default="item", help="item: one of a room; room: all")
    parser.add_argument("--updates", type=int, help="as many as the type has, if not given")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--jobs", type=int, default=2, help="trainings at once, on one core each")
    parser.add_argument("--runs", type=Path, default=Path("runs/ablation"))
    arguments = parser.parse_args()
    runs = arguments.runs.expanduser()
    for name, value in (("--updates", arguments.updates), ("--jobs", arguments.jobs)):
        within(name, value, value is None or value >= 1, "1 or more")
    scope, changes = arguments.scope, CHANGES[arguments.scope]
    room = composed("train", f"room={arguments.room_type}").room
    updates = arguments.updates or (room.updates if scope == "item" else room.whole_updates)
    about = {
        "room_type": arguments.room_type,
        "scope": scope,
        "data_seed": DATA_SEED,
        "updates": updates,
        "seeds": arguments.seeds,
    }
    ending = "" if scope == "item" else "-rooms"
    file = KEPT / f"{arguments.room_type}{ending}.json"
    check_kept(file, about)
    for folder in (runs, KEPT):
        folder.mkdir(parents=True, exist_ok=True)

    def asked(change: str, seed: int) -> tuple[Path, list[str]]:
        """The folder of a run, and its settings."""
        name = f"{change.replace(' ', '-').replace(',', '')}{ending}-{updates}-seed{seed}"
        settings = [f"data.seed={DATA_SEED}", *ALWAYS[scope], f"seed={seed}", f"method.updates.default={updates}"]
        return runs / arguments.room_type / name, [*settings, *changes[change]]

    def evaluation(change: str, seed: int) -> dict[str, Any]:
        found = trained(arguments.room_type, *asked(change, seed))
        print(f"{change}, seed {seed}: {found['rows']['agent']['mean_iou']:.3f}", flush=True)
        return found

    for wanted, settings in (asked(change, seed) for change in changes for seed in arguments.seeds):
        if folder := begun(wanted):
            check_as_before(arguments.room_type, settings, folder)
    with ThreadPoolExecutor(arguments.jobs) as pool:
        pending = {change: [pool.submit(evaluation, change, seed) for seed in arguments.seeds] for change in changes}
        found = {change: [future.result() for future in futures] for change, futures in pending.items()}
    machine = next(iter(found.values()))[0]["machine"]
    result = about | {"machine": machine, "rows": {change: row(each) for change, each in found.items()}}
    write_json(file, result)
    print(f"\n{table(result).markdown()}\nwrote {file}")


if __name__ == "__main__":
    main()
