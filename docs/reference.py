"""Build the API reference of layoutrl with pdoc: python -W error docs/reference.py [folder], by default docs/api."""

from __future__ import annotations

import csv
import importlib
import pkgutil
import sys
from pathlib import Path
from types import GenericAlias
from typing import get_type_hints

import pdoc
from tqdm import tqdm

import layoutrl


def modules() -> list[str]:
    """The names of all modules of the package that hold something to import."""
    found = (module.name for module in pkgutil.walk_packages(layoutrl.__path__, "layoutrl."))
    return ["layoutrl", *(name for name in found if not name.endswith(".__main__"))]


def resolve_constructors(module: str) -> None:
    """Give the constructors of its dataclasses and named tuples types for strings.

    They are functions of no module, or of one that lacks a base's imports: there pdoc looks names up in vain.
    """
    for thing in vars(importlib.import_module(module)).values():
        fields = getattr(thing, "__dataclass_fields__", None) or getattr(thing, "_fields", None)
        if isinstance(thing, type) and thing.__module__ == module and fields:
            hints = get_type_hints(thing)
            for constructor in (thing.__new__, thing.__init__):
                annotations = getattr(constructor, "__annotations__", {})
                annotations |= {name: hints[name] for name in annotations.keys() & hints.keys()}


def main(folder: Path) -> None:
    """Write the pages into a folder."""
    for thing in (csv.DictWriter, tqdm):  # which are generic to type checkers alone
        thing.__class_getitem__ = classmethod(GenericAlias)  # type: ignore[union-attr]
    for name in modules():
        resolve_constructors(name)
    pdoc.render.configure(footer_text=f"layoutrl {layoutrl.__version__}", show_source=False)
    pdoc.pdoc("layoutrl", output_directory=folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("api"))
