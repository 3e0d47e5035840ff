"""python -m layoutrl.planit.train room=<type> data=<source> budget=<smoke|default|full> seed=0

or resume=<folder of a run>, which goes on as if it had never stopped.
"""

from __future__ import annotations

from pathlib import Path

from layoutrl.rooms.sources.parts import two_parts
from layoutrl.runs.commands import command
from layoutrl.runs.config import PlanitCommand, PlanitConfig, narrowed, seeds


def run(config: PlanitConfig, folder: Path | None = None) -> Path:
    """Train, score in the held-out rooms, and return the run's folder; `folder` is a run to go on with.

    Raises Stopped where the user stops it.
    """
    # Imported here: they load torch, which takes seconds, and a wrong option is answered before.
    from layoutrl.rivals.budgets import updates_budget
    from layoutrl.rivals.planit.scoring import evaluated, table
    from layoutrl.runs.machine import device_of
    from layoutrl.runs.planit_training import train, usable
    from layoutrl.runs.resume import check_folder, evaluation_session, finish, stopped

    device = device_of(config.device)  # raises before the rooms are made, which takes a while
    check_folder(config, folder)
    training, held_out = usable(*two_parts(config.room.type, config.room.item, config.data, config.fold))
    total = config.method.updates[config.budget.name]
    trained = train(config, training, held_out, updates_budget(total), device, folder)
    folder = trained.folder
    if trained.stopped:
        raise stopped(folder, config, trained.updates, total)
    with evaluation_session(folder, config):
        result = evaluated(trained.placer, config.budget.evaluation_rooms, seeds(config)[3])
        finish(
            folder,
            config,
            result,
            table(result),
            device=device,
            updates=trained.updates,
            seconds=trained.seconds,
        )
    return folder


def carry_out(command_line: PlanitCommand) -> None:
    """Train as configured, or go on with a run."""
    from layoutrl.runs.resume import start_or_resume

    start_or_resume(narrowed(command_line, PlanitConfig), command_line.resume, run)


main = command("planit", PlanitCommand, carry_out)

if __name__ == "__main__":
    main()
