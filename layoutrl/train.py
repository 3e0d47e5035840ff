"""python -m layoutrl.train room=<type> [scope=room] [data=<source>] [method=<name>] [budget=<name>] [seed=0]

or resume=<folder of a run>, which goes on as if it had never stopped.
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from layoutrl.rooms.sources.parts import none_empty, parts_of
from layoutrl.runs.commands import command
from layoutrl.runs.config import TrainCommand, TrainConfig, narrowed, seeds


def run(config: TrainConfig, folder: Path | None = None) -> Path:
    """Train, evaluate on the held-out rooms, and return the run's folder; `folder` is a run to go on with.

    Raises Stopped where the user stops it.
    """
    # Imported here: they load torch, which takes seconds, and a wrong option is reported before that.
    from layoutrl.runs.machine import device_of
    from layoutrl.runs.monitor import record_result
    from layoutrl.runs.report import scored
    from layoutrl.runs.resume import check_folder, evaluation_session, finish, stopped
    from layoutrl.runs.training import train

    device = device_of(config.device)  # checked before the rooms are made, which takes a while
    check_folder(config, folder)
    scope, room = config.method.scope, config.room
    training, held_out = none_empty(*parts_of(scope, room.type, room.item, config.data, config.fold))
    trained = train(config, training, held_out, device, folder)
    learner, folder = trained.learner, trained.folder
    if trained.stopped:
        raise stopped(folder, config, learner.dqn.updates, learner.total_updates)
    with evaluation_session(folder, config):
        result, shown = scored(learner.agent, config.reward, held_out, training, seeds(config)[3])
        record_result(folder, asdict(config), result, learner.dqn.updates)
        finish(
            folder,
            config,
            result,
            shown,
            device=device,
            updates=learner.dqn.updates,
            seconds=trained.seconds,
        )
    return folder


def carry_out(command_line: TrainCommand) -> None:
    """Train as configured, or go on with a run."""
    from layoutrl.runs.resume import start_or_resume

    start_or_resume(narrowed(command_line, TrainConfig), command_line.resume, run)


main = command("train", TrainCommand, carry_out)

if __name__ == "__main__":
    main()
