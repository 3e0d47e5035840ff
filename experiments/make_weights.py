"""The agents in the package, from nothing: layoutrl/weights/ and docs/agents.md.

    python experiments/make_weights.py [room=kitchen,study] [budget=smoke]
    python experiments/make_weights.py runs=<folder> results=<folder> [room=kitchen,study]
    python experiments/make_weights.py scores=<folder> [room=kitchen,study]

The first trains one agent for each type of room and scores it in unseen briefs, as column=rooms_agent of Table 3 does;
finished agents are not trained again. The second trains nothing: it takes finished agents from the folders that were
`runs` and `results` of such trainings. Both write the networks, rounded to 16 bits. The third keeps the networks, and
takes new scores of them, as agents furnish now, from the cells of column=rooms_package in the folder that was their
`results`. All three furnish the first 256 unseen briefs with the rounded networks, to score each category of items, and
write weights.json and, from it, the page. A type that fails is named and keeps its old entry, and the others go on.

Further options: weights=<folder> for networks and page, instead of the package's; version=<n>, the version of the
weights.
"""

from __future__ import annotations

import hashlib
import io
import json
import sys
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from cell_config import LAYOUTS
from packing import unpacked_iou
from sweeps import cells_of, command_line, multirun, parsed_options, some_of

from layoutrl import InputError
from layoutrl.env.measures import measured
from layoutrl.evaluation.furnishing import Furnisher
from layoutrl.evaluation.layouts import by_category
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.faults import FAULTS, MISSING
from layoutrl.rooms.furnished import best_layouts
from layoutrl.rooms.room import MAIN_ITEM
from layoutrl.runs.commands import answers_errors
from layoutrl.runs.config import TrainConfig
from layoutrl.runs.files import write_json
from layoutrl.runs.folder import differences, load_config, stated
from layoutrl.runs.pretrained import ABOUT, unpacked
from layoutrl.runs.trained import kept_agent

PROJECT = Path(__file__).resolve().parents[1]
WEIGHTS, PAGE = PROJECT / "layoutrl/weights", PROJECT / "docs/agents.md"
COLUMN, PACKAGED = "rooms_agent", "rooms_package"
LICENCE = "MIT"
LOOKED_AT = 256  # unseen briefs in which items are scored: whole blocks of rooms that are furnished at once
WORST = 0.8  # IoU below which an agent is said to be bad at an item
SAME = 0.01  # mean difference of the rooms' IoU, up to which they count as furnished alike
ACROSS = 4  # agents side by side in a table
FEW = 10  # with fewer items of a category an agent is not said to be bad at it
MEASURES = {
    "iou": "IoU",
    "facing": "facing",
    "faultless": "faultless",
    "missing": "no place",
    "overlap": "overlap",
    "overlap_area": "overlapping area",
    "outside": "outside",
    "outside_area": "area outside",
    "blocked": "blocked",
    "reached": "reached",
    "fronts": "front free",
    "walkable": "walkable",
    "reach": "reach",
    "moved": "moved, m",
}


@answers_errors()
def main(arguments: list[str]) -> int:
    """Make the agents or scores that are asked for; the exit status is not 0 if a type failed."""
    chosen = parsed_options(arguments, "weights", "version", "scores")
    types = some_of("room", chosen, MAIN_ITEM)
    folder, version = Path(chosen.pop("weights", WEIGHTS)), chosen.pop("version", None)
    if version is not None and not version.isdecimal():
        raise InputError(f"version: expected a whole number; got {version}")
    page = PAGE if folder == WEIGHTS else folder / PAGE.name
    scores = chosen.pop("scores", None)
    others = [name for name in ("runs", "results", "seed") if name in chosen] + ["weights"] * (folder != WEIGHTS)
    if scores is not None and others:
        raise InputError(f"{others[0]}: expected none with scores=, which are of the networks in the package")
    status = 0
    if scores is None and "runs" not in chosen:
        status = multirun("table3", {"column": COLUMN} | chosen | {"room": ",".join(types)})
    folder.mkdir(parents=True, exist_ok=True)
    about: dict[str, Any] = {"version": 1, "licence": LICENCE, "agents": {}}
    if (file := folder / ABOUT).exists():
        about = json.loads(file.read_text(encoding="utf-8"))
    about["version"] = int(version or about["version"])
    for room_type in types:
        try:
            before = about["agents"].get(room_type)
            card = (
                made(room_type, chosen, folder, before)
                if scores is None
                else scored(room_type, chosen | {"results": scores}, before)
            )
        except Exception as problem:  # whatever it is: the other types shall not suffer
            print(f"{room_type} failed: {problem}", file=sys.stderr, flush=True)
            status = 1
            continue
        agents = about["agents"] | {room_type: card}
        about["agents"] = {kind: agents[kind] for kind in MAIN_ITEM if kind in agents}
        write_json(file, about)
        page.write_text(page_of(about), encoding="utf-8")
        print(f"{room_type}: IoU {card['measures']['iou']:.3f}, {card['bytes']} bytes", flush=True)
    return status


def made(room_type: str, chosen: Mapping[str, str], folder: Path, before: dict[str, Any] | None) -> dict[str, Any]:
    """Write the network of a type and return its card, `before` if it is the same. Raises InputError if unfinished."""
    cell = finished(room_type, COLUMN, chosen)
    run = run_of(cell, Path(chosen.get("runs", "runs")))
    learned = kept_agent(run, load_config(run, TrainConfig), torch.device("cpu")).agent
    told = json.loads((run / "trained.json").read_text(encoding="utf-8"))
    release, commit = commit_of(told["trained_on_machine"])
    stream = io.BytesIO()
    torch.save({part: values.half() for part, values in learned.network.state_dict().items()}, stream)
    content, config = stream.getvalue(), cell["config"]
    card = {
        "file": f"{room_type}.pt",
        "sha256": hashlib.sha256(content).hexdigest(),
        "bytes": len(content),
        "licence": LICENCE,
        "command": command_of(config),
        "seed": config["seed"],
        "data": {"source": config["data"]["source"], "seed": config["data"]["seed"], "rooms": cell["training_rooms"]},
        "updates": told["updates"],
        "minutes": round(told["training_seconds"] / 60, 1),
        "layoutrl": release,
        "commit": commit,
        "categories": learned.categories,
        "method": asdict(learned.method),
    } | scores_of(cell)
    if before and {name: before[name] for name in card if name in before} == card and (folder / card["file"]).exists():
        return before
    card["items"], iou = items_of(Furnisher(unpacked(content, card, torch.device("cpu"))), config)
    _, exact = items_of(Furnisher(learned), config)
    card["rounded"] = {"iou": float(iou.mean()), "iou_before": float(exact.mean())}
    (folder / card["file"]).write_bytes(content)
    return card


def scored(room_type: str, chosen: Mapping[str, str], before: dict[str, Any] | None) -> dict[str, Any]:
    """Return the card of a network in the package, with the scores of a cell.

    Raises InputError if there is no such network or cell, and if the cell is of another network or other code.
    """
    if before is None:
        raise InputError(f"room: the package has no network for a {room_type}; expected one of those that it has")
    cell = finished(room_type, PACKAGED, chosen)
    agent = unpacked((WEIGHTS / before["file"]).read_bytes(), before, torch.device("cpu"))
    items, iou = items_of(Furnisher(agent), cell["config"])
    said = unpacked_iou(cell["rows"][LAYOUTS]["iou"])[: len(iou)]
    if np.abs(said - iou).mean() > SAME:
        raise InputError(
            f"scores: the cell's rooms have an IoU of {said.mean():.4f}, and now {iou.mean():.4f}; fill it anew"
        )
    return before | scores_of(cell) | {"items": items}


def finished(room_type: str, column: str, chosen: Mapping[str, str]) -> dict[str, Any]:
    """Return a filled cell of Table 3. Raises InputError if it is not filled."""
    name = f"{room_type}-own-{column}-seed{chosen.get('seed', '0')}"
    if not (file := cells_of("table3", chosen) / f"{name}.json").exists():
        raise InputError(f"results: {file} is not there; expected a filled cell of column={column}")
    return json.loads(file.read_text(encoding="utf-8"))


def scores_of(cell: Mapping[str, Any]) -> dict[str, Any]:
    """Return an agent's scores from a cell, and the commit of the code by which it furnished."""
    row = cell["rows"][LAYOUTS]
    return {
        "rooms": cell["rooms"],
        "measures": {name: row[name] for name in MEASURES} | {"iou": row["mean_iou"]},
        "standard_errors": {name: row[f"{name}_error"] for name in MEASURES},
        "seconds": row["seconds"],
        "furnished_by": commit_of(cell["machine"])[1],
    }


def commit_of(machine: Mapping[str, Any]) -> tuple[str, str]:
    """The release of layoutrl that ran, and its commit."""
    release, _, commit = machine["layoutrl"].partition(" ")
    return release, commit


def run_of(cell: Mapping[str, Any], runs: Path) -> Path:
    """Return the folder in `runs` of the finished training that a cell scored. Raises InputError if there is none."""
    config = cell["config"]
    folder = runs / config["room"]["type"]
    for run in sorted(folder.glob(f"{COLUMN}-*-seed{config['seed']}")):
        if (run / "trained.json").exists() and not differences(stated(load_config(run, TrainConfig)), config):
            return run
    raise InputError(f"runs: {folder} has no finished training of {COLUMN} as the cell says; expected its folder")


def command_of(config: Mapping[str, Any]) -> str:
    """Return the command that trains the agent of a cell and scores it."""
    told = ("train_rooms", "test_rooms", "seed", "disturbed")
    data = " ".join(f"data.{name}={config['data'].get(name, 0.0)}" for name in told)
    budget = config["budget"]["name"]
    updates = f"method.updates.{budget}={config['method']['updates'][budget]}"
    what = f"room={config['room']['type']} budget={budget} {updates} {data} seed={config['seed']}"
    return f"python experiments/cells.py table=table3 column={COLUMN} {what}"


def items_of(furnisher: Furnisher, config: Mapping[str, Any]) -> tuple[dict[str, Any], np.ndarray]:
    """Return an agent's scores in the first unseen briefs, by category of items, and the IoU of each room (B,)."""
    count = min(LOOKED_AT, config["data"]["test_rooms"])
    designs = design_rooms(config["room"]["type"], "test", config["data"]["seed"], count).rooms
    layouts = best_layouts(furnisher, [brief_of(design) for design in designs])
    iou = measured(layouts, designs).iou
    return {"rooms": len(designs), "iou": float(iou.mean()), "categories": by_category(layouts, designs)}, iou


def page_of(about: Mapping[str, Any]) -> str:
    """Return the text of docs/agents.md, which has a card for each agent."""
    agents = about["agents"]
    types, size = ", ".join(map(words, agents)), sum(card["bytes"] for card in agents.values()) / 1e6
    lines = [
        "# The agents in the package",
        "",
        f"Each furnishes rooms of one type: {types}. `place` uses them where no other is named by `run=` or `by=`, and",
        "so does the page of `make demo`. They are networks of DQN agents, trained on designed rooms alone.",
        f"Together the files have {size:.1f} MB. Licence: {about['licence']}. "
        f"Version of the weights: {about['version']}.",
        "",
        "    python experiments/make_weights.py results=<new folder>",
        "",
        "trains agents like them from nothing, by the settings of today (each card names the commit of its own),",
        "scores them, and writes this page from",
        "[weights.json](../layoutrl/weights/weights.json), which has every setting. With",
        "`runs=<folder> results=<folder>` it takes what is trained already. The commands below want a new folder,",
        "too: a cell that is there counts as done.",
        "",
        "    python experiments/cells.py table=table3 column=rooms_package room=bathroom,bedroom results=<new folder>",
        "    python experiments/make_weights.py scores=<that folder> room=bathroom,bedroom",
        "",
        "scores the agents as they are in the package, and trains nothing. The measures are those of",
        "[whole_rooms.md](whole_rooms.md#measures): means over unseen designed briefs, furnished from nothing, with",
        "the standard error over rooms. In the authors' real bedrooms and tatami rooms [their IoU is far",
        "lower](whole_rooms_results.md#the-authors-real-bedrooms-and-tatami-rooms).",
        "[rooms.md](rooms.md#how-well-it-works-on-files-that-people-have) says how they do in people's own files.",
        "",
        "| agent | unseen briefs | IoU | facing | faultless | core-seconds a room |",
        "| --- | --- | --- | --- | --- | --- |",
        *(
            f"| [{words(room_type)}](#{words(room_type).replace(' ', '-')}) | {card['rooms']:,} | "
            + " | ".join(f"{card['measures'][name]:.3f}" for name in ("iou", "facing", "faultless"))
            + f" | {card['seconds']:.2f} |"
            for room_type, card in agents.items()
        ),
        "",
        "All measures, with their standard errors:",
    ]
    for first in range(0, len(agents), ACROSS):
        some = [*agents][first : first + ACROSS]
        lines += ["", f"| | {' | '.join(map(words, some))} |", "| --- |" + " --- |" * len(some)]
        for name, label in MEASURES.items():
            found = ((agents[each]["measures"][name], agents[each]["standard_errors"][name]) for each in some)
            lines.append(f"| {label} | {' | '.join(f'{mean:.3f} ({error:.3f})' for mean, error in found)} |")
    lines += [
        "",
        "Below, the IoU before and after rounding is of the way in which agents furnished when each was made.",
    ]
    for room_type, card in agents.items():
        lines += ["", *card_of(room_type, card)]
    return "\n".join(lines) + "\n"


def card_of(room_type: str, card: Mapping[str, Any]) -> list[str]:
    """The card of one agent, line by line."""
    data, items, rounded = card["data"], card["items"], card["rounded"]
    kinds = {words(category): row for category, row in items["categories"].items()}
    bad = [f"{kind} ({row['iou']:.2f})" for kind, row in kinds.items() if row["iou"] < WORST and row["count"] >= FEW]
    return [
        f"## {words(room_type).capitalize()}",
        "",
        f"- `layoutrl/weights/{card['file']}`: {card['bytes']:,} bytes, licence {card['licence']}, SHA-256",
        f"  `{card['sha256']}`",
        f"- `{card['command']}`",
        f"- Trained on {data['rooms']:,} rooms of the {data['source']} (`data.seed={data['seed']}`), seed",
        f"  {card['seed']}, for {card['updates']:,} updates, in {card['minutes']} minutes; layoutrl",
        f"  {card['layoutrl']}, commit {card['commit']}",
        f"- In {items['rooms']} unseen briefs its IoU was {rounded['iou_before']:.3f} before its weights were",
        f"  rounded to 16 bits, and {rounded['iou']:.3f} after, as it is shipped",
        f"- All that follows is scored as agents furnish in commit {card['furnished_by']}",
        f"- Places: {', '.join(map(words, card['categories']))}",
        f"- Bad at (IoU below {WORST}): {', '.join(bad) or 'nothing'}",
        "",
        f"In the first {items['rooms']} of these briefs its mean IoU is {items['iou']:.3f}. What it places there:",
        "",
        "| item | how many | IoU | share with a fault |",
        "| --- | --- | --- | --- |",
        *(f"| {kind} | {row['count']} | {row['iou']:.3f} | {faulty(row)} |" for kind, row in kinds.items()),
    ]


def faulty(row: Mapping[str, float]) -> str:
    """Return the faults of a category, each with the share of items that have it, or "none"."""
    return ", ".join(f"{row[name]:.3f} {name}" for name in FAULTS if name != MISSING and row[name]) or "none"


def words(name: str) -> str:
    """Return the name of a room type or category with blanks for underscores."""
    return name.replace("_", " ")


if __name__ == "__main__":
    sys.exit(main(command_line(__doc__)))
