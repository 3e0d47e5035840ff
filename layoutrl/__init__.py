"""layoutrl: an agent that moves furniture to where a designer would have put it (Di & Yu 2021)."""

import os
import signal
import sys
from itertools import pairwise

_asked = os.path.basename(sys.argv[0]) in ("layoutrl", "layoutrl.exe") or any(  # noqa: PTH119
    flag == "-m" and name.split(".")[0] == "layoutrl" for flag, name in pairwise(sys.orig_argv)
)
if _asked and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    # Run as a command: imports take seconds, and Ctrl-C ends them without a traceback.
    signal.signal(signal.SIGINT, signal.SIG_DFL)

import gymnasium  # noqa: E402

__version__ = "0.3.0"

gymnasium.register(
    "layoutrl/Layout-v0",
    entry_point="layoutrl.env.layout_env:LayoutEnv",
    vector_entry_point="layoutrl.env.vector_env:LayoutVectorEnv",
)
gymnasium.register(
    "layoutrl/Rooms-v0",
    entry_point="layoutrl.env.rooms_env:RoomsEnv",
    vector_entry_point="layoutrl.env.rooms_vector_env:RoomsVectorEnv",
)


class InputError(ValueError):
    """What the user gave cannot be used; the message says what, where, and how to mend it."""
