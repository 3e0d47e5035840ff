"""Limits torch to one thread while rooms are furnished."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import RLock

import torch

ALONE = RLock()  # held while a caller furnishes


@contextmanager
def one_thread() -> Iterator[None]:
    """Run the block on one thread of torch, one caller at a time: the number of threads is global to the process.

    Furnishing makes many small operations. On an idle machine a second thread saves a tenth of their time; on a busy
    one, where threads wait for each other, they take up to sixty times as long.
    """
    with ALONE:
        threads = torch.get_num_threads()
        torch.set_num_threads(1)
        try:
            yield
        finally:
            torch.set_num_threads(threads)
