"""layoutrl <command> [<option>=<value> ...], as python -m layoutrl.<command> ...; alone it lists the commands."""

from __future__ import annotations

import difflib
import sys
from importlib import import_module

from layoutrl import __version__

COMMANDS = {
    "place": "puts furniture where it belongs, in rooms of your own",
    "demo": "shows a page to furnish rooms on",
    "train": "trains an agent, and scores it in held-out rooms",
    "evaluate": "scores a trained agent again: other rooms, more starts",
    "watch": "makes an animation of a trained agent",
    "gallery": "draws the rooms of a source",
    "bench": "measures speed and memory",
    "planit.train": "trains PlanIT, the rival",
}


def main() -> None:
    """Do what the arguments say: the first names the command, the others are its options."""
    name, *options = sys.argv[1:] or ["--help"]
    if name in ("--help", "-h", "help"):
        width = max(map(len, COMMANDS))
        print(
            "layoutrl <command> [<option>=<value> ...]", *(f"  {k:{width}}  {COMMANDS[k]}" for k in COMMANDS), sep="\n"
        )
        print("layoutrl <command> --help shows its options, layoutrl --version the version")
    elif name == "--version":
        print(f"layoutrl {__version__}")
    elif name in COMMANDS:
        sys.argv = [f"layoutrl {name}", *options]
        import_module(f"layoutrl.{name}").main()
    else:
        (near,) = difflib.get_close_matches(name, COMMANDS, 1, 0)
        sys.exit(f"error: {name}: expected a command, of which {near} is nearest; layoutrl alone lists all")


if __name__ == "__main__":
    main()
