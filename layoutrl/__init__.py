"""layoutrl: an agent that moves furniture to where a designer would have put it (Di & Yu 2021)."""

import gymnasium

__version__ = "0.2.0"

gymnasium.register(
    "layoutrl/Layout-v0",
    entry_point="layoutrl.env.layout_env:LayoutEnv",
    vector_entry_point="layoutrl.env.vector_env:LayoutVectorEnv",
)


class InputError(ValueError):
    """What the user gave cannot be used; the message says what, where, and how to mend it."""
