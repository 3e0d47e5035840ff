"""What does not fit the shape of a configuration is told by its name and kind."""

from __future__ import annotations

from functools import reduce
from typing import Any

import pytest
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from layoutrl.runs.config import (
    BenchConfig,
    DemoConfig,
    EvaluateConfig,
    GalleryConfig,
    PlaceConfig,
    PlanitCommand,
    TrainCommand,
    WatchConfig,
)
from layoutrl.runs.wording import misfit, options

SCHEMAS = {
    "train": TrainCommand, "planit": PlanitCommand, "evaluate": EvaluateConfig, "watch": WatchConfig,
    "place": PlaceConfig, "demo": DemoConfig, "gallery": GalleryConfig, "bench": BenchConfig,
}  # fmt: skip
WRONG: dict[Any, tuple[Any, str]] = {  # a value of another kind, and what is said to be expected
    int: ("many", "a whole number"),
    float: ("much", "a number"),
    bool: ("perhaps", "true or false"),
    str: ([1], "a text"),
    list[str]: (1, "a list, as [1,2]"),
    list[int]: (1, "a list, as [1,2]"),
    list[float]: (1, "a list, as [1,2]"),
    dict[str, int]: (1, "names with values"),
    dict[str, float]: (1, "names with values"),
}
WRONG |= {kind | None: said for kind, said in [*WRONG.items()] if isinstance(kind, type)}


@pytest.mark.parametrize("command", SCHEMAS)
def test_a_value_of_the_wrong_kind_is_told_by_the_name_of_its_option_and_what_it_takes(command: str) -> None:
    schema, tried = SCHEMAS[command], 0
    for name, kind in options(schema).items():
        if kind is not Any:  # __post_init__ checks these
            value, expected = WRONG[kind]
            given = reduce(lambda inner, part: {part: inner}, reversed(name.split(".")), value)
            with pytest.raises(OmegaConfBaseException) as error:
                OmegaConf.merge(schema, given)
            assert misfit(error.value, schema) == f"{name}: expected {expected}"
            tried += 1
    assert tried > 2
