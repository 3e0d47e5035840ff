"""python -m layoutrl.evaluate run=<folder> [data=... data.root=...] [part=held_out|training|all] [starts=1]"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import hydra
import numpy as np
from omegaconf import DictConfig, OmegaConf

from layoutrl.runs.commands import answers_errors
from layoutrl.runs.config import EvaluateConfig, config_directory, register
from layoutrl.runs.folder import write_json
from layoutrl.runs.machine import machine
from layoutrl.runs.report import evaluate, table
from layoutrl.runs.trained import trained_run


def run(config: EvaluateConfig) -> dict[str, Any]:
    """Score a trained agent; prints a table and stores it as evaluation-<data>-....json in the run's folder."""
    shown = trained_run(config)
    result = evaluate(
        shown.policy,
        shown.simulator,
        shown.observe,
        shown.training,
        starts_a_room=config.starts,
        seed=np.random.SeedSequence(config.seed),
    )
    print(table(result))
    file = Path(config.run) / f"evaluation-{shown.name}-{config.starts}-seed{config.seed}.json"
    about = {
        "data": asdict(shown.data),
        "part": shown.part,
        "seed": config.seed,
        "machine": machine(shown.policy.device),
    }
    write_json(file, about | result)
    print(f"wrote {file}")
    return result


register()


@hydra.main(version_base="1.3", config_path=str(config_directory()), config_name="evaluate")
@answers_errors
def main(config: DictConfig) -> None:
    run(OmegaConf.to_object(config))  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
