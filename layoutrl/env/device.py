"""The device that tensors are on."""

from __future__ import annotations

import numpy as np
import torch

from layoutrl import InputError

REASON = 80  # letters of torch's own words that a message holds: some of its first lines are a paragraph


def usable_device(device: torch.device | str, *others: str) -> torch.device:
    """Return the device of a name. Raises InputError if this machine has none such; the message also lists `others`."""
    try:
        chosen = torch.device(device)
        # Positions are of double precision, which some devices do not have; a device without memory refuses any.
        torch.zeros(1, dtype=torch.float64, device=chosen).item()
    except (RuntimeError, AssertionError, TypeError, ImportError) as error:
        known, reason = ", ".join([*others, "cpu"]), str(error).partition("\n")[0][:REASON]
        raise InputError(
            f"device: expected {known} or a GPU of this machine, as cuda:0; got {device} ({reason})"
        ) from None
    return chosen


def generator_of(seed: np.random.SeedSequence, device: torch.device | str) -> torch.Generator:
    """Return a generator on a device that draws as the seed says."""
    return torch.Generator(device).manual_seed(int(seed.generate_state(1)[0]))
