"""python -m layoutrl.evaluate run=<folder> [data=... data.root=...] [part=held_out|training|all] [starts=1] [out=]"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from layoutrl import InputError
from layoutrl.rooms.files import check_new
from layoutrl.runs.commands import command
from layoutrl.runs.config import EvaluateConfig, TrainConfig, seeds
from layoutrl.runs.files import check_writable, write_json, writing
from layoutrl.runs.folder import load_config, stated


def run(config: EvaluateConfig) -> dict[str, Any]:
    """Score a trained agent, print a table and return the result.

    The result is also written to `out`, or to evaluation-....json in the run's folder. Raises InputError before it
    reads rooms if that cannot be written, or if an agent of whole rooms is given more than one start.
    """
    trained = load_config(Path(config.run), TrainConfig)
    if trained.method.scope == "room" and config.starts > 1:
        raise InputError(f"starts: a whole room is furnished once, from nothing; expected 1; got {config.starts}")
    if config.out:
        check_new(Path(config.out), ".json")
    check_writable(Path(config.out).parent if config.out else Path(config.run), "out")
    # Imported here: they load torch, which takes seconds, and a wrong option is reported before that.
    from layoutrl.runs.machine import device_of, machine
    from layoutrl.runs.report import scored
    from layoutrl.runs.resume import EVALUATION
    from layoutrl.runs.trained import trained_run

    if config.out and Path(config.out).resolve() == (Path(config.run) / EVALUATION).resolve():
        raise InputError(f"out: a run with an {EVALUATION} is finished; expected another name")
    shown = trained_run(config)
    seed, which = seeds(trained)[3], ""
    if config.seed is not None:
        seed, which = np.random.SeedSequence(config.seed), f"-seed{config.seed}"
    file = Path(config.out or Path(config.run) / f"evaluation-{shown.name}-{config.starts}{which}.json")
    result, said = scored(shown.agent, shown.reward, shown.rooms, shown.training, seed, config.starts)
    print(said)
    about = {
        "run": config.run,
        "checkpoint": shown.checkpoint,
        "updates": shown.updates,
        "on_illegal": shown.agent.method.on_illegal,
        "data": asdict(shown.data),
        "part": shown.part,
        "seed": config.seed,  # null: that of the training
        "machine": machine(device_of(config.device)),
        "config": stated(trained),
    }
    if config.out:
        check_new(file, ".json")  # once more: scoring takes minutes
    with writing(file):
        write_json(file, about | result)
    print(f"wrote {file}")
    return result


main = command("evaluate", EvaluateConfig, run)

if __name__ == "__main__":
    main()
