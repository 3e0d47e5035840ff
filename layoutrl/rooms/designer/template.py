"""What a type of room is to the designer."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from layoutrl.rooms.designer.search import Step
from layoutrl.rooms.designer.shell import Dice, Shell


def any_shell(shell: Shell) -> bool:
    """A template that suits every shell."""
    return True


@dataclass(frozen=True)
class Template:
    """A way to furnish: its steps in a shell, how often it is chosen among those that suit the shell."""

    steps: Callable[[Dice, Shell], Sequence[Step]]
    share: int
    suits: Callable[[Shell], bool] = any_shell


@dataclass(frozen=True)
class RoomType:
    """Bare rooms, and the templates by name."""

    name: str
    shell: Callable[[Dice], Shell]
    templates: Mapping[str, Template]
