"""python -m layoutrl.evaluate run=<folder> [data=... data.root=...] [part=held_out|training|all] [starts=1]"""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import hydra
import numpy as np
from omegaconf import DictConfig, OmegaConf

from layoutrl import build
from layoutrl.config import EvaluateConfig, config_directory, register
from layoutrl.errors import InputError
from layoutrl.evaluation.report import evaluate, table
from layoutrl.runs import load_config, write_json


def run(config: EvaluateConfig) -> dict[str, Any]:
    """Score a trained agent; prints a table and stores it as evaluation-<data>-....json in the run's folder."""
    folder = Path(config.run)
    trained = load_config(folder)
    device = build.device(config.device)
    agent, categories = build.trained_agent(folder, trained.method, device)

    own, data = trained.data, config.data
    if data.source is None:  # the run's own, but for what is given
        given = {name: getattr(data, name) for name in ("root", "labels", "train_rooms", "test_rooms", "seed")}
        data = replace(own, **{name: value for name, value in given.items() if value is not None})
    designed = data.source == own.source == "designer"  # wherever their cache lies
    same = data.seed == own.seed if designed else (data.source, data.root) == (own.source, own.root)
    if designed and same:
        data = replace(data, train_rooms=own.train_rooms)  # the agent was trained on no more of them
    parts = build.rooms(trained.room, own, trained.fold)
    training = parts[0]
    if data != own:
        parts = build.rooms(trained.room, data, trained.fold)
    part = config.part or ("held_out" if same or data.source == "designer" else "all")
    rooms = {"training": parts[0], "held_out": parts[1], "all": parts[0] + parts[1]}[part]
    if not same:
        trained_on = {room.group for room in training}
        unseen = [room for room in rooms if room.group not in trained_on]
        if len(unseen) < len(rooms):
            print(f"left out {len(rooms) - len(unseen)} rooms that the agent was trained on")
        rooms = unseen
    if not rooms:
        raise InputError(f"part: {data.source} has no {part} rooms to score; expected another part, or more rooms")
    print(f"scoring {len(rooms)} rooms of {data.source} ({part})")

    method = replace(trained.method, on_illegal=config.on_illegal or trained.method.on_illegal)
    simulator = build.simulator(rooms, method, trained.reward)
    result = evaluate(
        build.greedy(agent, method),
        simulator,
        build.observation(rooms, method, categories, device),
        training,
        starts_a_room=config.starts,
        seed=np.random.SeedSequence(config.seed),
    )
    print(table(result))
    which = {
        "designer": f"-rooms{data.seed}",
        "floorplans": f"-{data.labels}",
        "json": f"-{Path(data.root or '').stem}",
    }.get(data.source or "", "")
    name = f"evaluation-{data.source}{which}-{part}-{config.starts}-{method.on_illegal}-seed{config.seed}.json"
    write_json(folder / name, {"data": asdict(data), "part": part, "seed": config.seed} | result)
    print(f"wrote {folder / name}")
    return result


register()


@hydra.main(version_base="1.3", config_path=str(config_directory()), config_name="evaluate")
@build.answers_errors
def main(config: DictConfig) -> None:
    run(OmegaConf.to_object(config))  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
