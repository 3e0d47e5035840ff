"""Templates and room types of the rule-based designer."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from layoutrl.rooms.designer.search import Step
from layoutrl.rooms.designer.shell import Dice, Shell


def any_shell(shell: Shell) -> bool:
    """Suit every shell."""
    return True


@dataclass(frozen=True)
class Template:
    """A way to furnish a room: `steps` returns the steps for a shell.

    `share` is its weight in the draw among the templates that suit the shell; `suits` says whether it suits one.
    """

    steps: Callable[[Dice, Shell], Sequence[Step]]
    share: int
    suits: Callable[[Shell], bool] = any_shell


@dataclass(frozen=True)
class RoomType:
    """A type of room: `shell` draws bare rooms; `templates` are the ways to furnish them, by name."""

    name: str
    shell: Callable[[Dice], Shell]
    templates: Mapping[str, Template]
