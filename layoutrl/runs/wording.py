"""Wording of messages: the names of options, values that do not fit them, and names with articles."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import is_dataclass
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from omegaconf.errors import ConfigAttributeError, ConfigKeyError, MissingMandatoryValue, OmegaConfBaseException

WORDS: dict[Any, str] = {
    int: "a whole number", float: "a number", bool: "true or false", str: "a text", list: "a list, as [1,2]",
}  # fmt: skip


def options(schema: type, prefix: str = "") -> dict[str, Any]:
    """The types of all options, by their dotted names."""
    found: dict[str, Any] = {}
    for name, kind in get_type_hints(schema).items():
        found |= options(kind, f"{prefix}{name}.") if is_dataclass(kind) else {prefix + name: kind}  # type: ignore[arg-type]
    return found


def misfit(error: OmegaConfBaseException, schema: type) -> str:
    """Return what does not fit the schema of a configuration, and where."""
    key = error.full_key or ""
    if isinstance(error, ConfigAttributeError | ConfigKeyError):
        return f"{key}: unknown"
    if isinstance(error, MissingMandatoryValue):
        return f"{key}: lacking"
    kinds, name = options(schema), key.partition("[")[0]  # method.steps of method.steps[0]
    if name not in kinds:  # method.updates of method.updates.smoke
        name = name.rpartition(".")[0]
    kind = kinds.get(name)
    if within := get_args(kind):
        kind = within[-1] if name != key else within[0] if isinstance(kind, UnionType) else get_origin(kind)
    return f"{key or 'a section'}: expected {WORDS.get(kind, 'names with values')}"


def any_of(names: Iterable[str]) -> str:
    """Names with their articles: `an armchair or a bed`."""
    return " or ".join(f"{'an' if name[:1].lower() in [*'aeiou'] else 'a'} {name}" for name in names)
