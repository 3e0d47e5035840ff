"""A device is there, or it is said in a line what would be."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from layoutrl import InputError
from layoutrl.env.device import usable_device

NAMES = st.sampled_from(
    ["cuda", "cpu", "meta", "mps", "xpu", "vulkan", "mkldnn", "hpu", "", "cpu:0", "CPU", "cuda:-1", "gpu"]
)


TEXTS = st.text(st.characters(exclude_categories=["C"]), max_size=9)


@given(NAMES | st.builds("{}:{}".format, NAMES, st.integers(-1, 300)) | TEXTS)
def test_what_is_named_holds_tensors_or_is_answered_in_a_line(name: str) -> None:
    try:
        torch.zeros(3, device=name).tolist()
    except (RuntimeError, AssertionError, ImportError):
        with pytest.raises(InputError) as answer:
            usable_device(name, "auto")
        said = f"device: expected auto, cpu or a GPU of this machine, as cuda:0; got {name} ("
        assert str(answer.value).startswith(said)
        assert len(str(answer.value).splitlines()) == 1
        assert len(str(answer.value)) < len(said) + 100  # a GPU that torch lacks is told in a paragraph
    else:
        assert torch.arange(3, device=usable_device(name)).tolist() == [0, 1, 2]
