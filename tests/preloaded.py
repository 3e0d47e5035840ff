"""What a fork server does last, once for all processes that are forked from it."""

import gc

from layoutrl.runs.config import composed

composed("train", "room=bedroom")  # Hydra looks for plugins, and its parsers learn the grammar of options
gc.freeze()  # else the garbage collector of each process would look through all that was imported, and so copy it
