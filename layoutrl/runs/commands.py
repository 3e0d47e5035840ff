"""What entry points share: errors are answered in one line."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from omegaconf.errors import OmegaConfBaseException

from layoutrl import InputError

P = ParamSpec("P")
R = TypeVar("R")


def answers_errors(entry_point: Callable[P, R]) -> Callable[P, R]:
    """Answer what the user can mend in one line, without a traceback."""

    @wraps(entry_point)
    def answering(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return entry_point(*args, **kwargs)
        except (InputError, OmegaConfBaseException) as error:
            sys.exit(f"error: {error}")
        except OSError as error:  # a full disk, no permission
            sys.exit(f"error: {error.filename or 'a file'}: {error.strerror}; expected to be able to read or write it")
        except KeyboardInterrupt:
            sys.exit("interrupted")

    return answering
