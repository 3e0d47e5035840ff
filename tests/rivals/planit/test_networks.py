"""The image networks: what their answers hang on, and what they cannot."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from layoutrl.rivals.planit.graph import TYPES
from layoutrl.rivals.planit.networks import (
    HEAT_SIDE,
    LATENT,
    SIDE,
    LocationNetwork,
    PictureNetwork,
    SizeNetwork,
    signed_distance,
)

CHANNELS, CATEGORIES = 5, 3


def pictures(count: int) -> Tensor:
    return torch.rand(count, CHANNELS, SIDE, SIDE, generator=torch.Generator().manual_seed(0))


@pytest.fixture(scope="module")
def location() -> LocationNetwork:
    torch.manual_seed(0)
    network = LocationNetwork(CHANNELS, CATEGORIES)
    network(pictures(4), torch.arange(4))  # batch statistics
    return network.eval()


@torch.no_grad()
def test_of_every_pixel_it_says_which_category_and_its_answer_hangs_on_the_type_of_the_edge(location) -> None:
    one = pictures(1).expand(len(TYPES), -1, -1, -1)
    answers = location(one, torch.arange(len(TYPES)))
    assert answers.shape == (len(TYPES), 1 + CATEGORIES, HEAT_SIDE, HEAT_SIDE)
    assert len(answers.flatten(1).unique(dim=0)) == len(TYPES)
    alone = location(one[:1], torch.tensor([0]))  # not on the others of a batch
    torch.testing.assert_close(answers[:1], alone, atol=1e-4, rtol=0)


@torch.no_grad()
def test_what_it_says_of_a_pixel_hangs_on_the_whole_picture(location) -> None:
    """All passes through a single pixel."""
    picture = pictures(1)
    other = picture.clone()
    other[..., -8:, -8:] = 0
    before, after = (location(p, torch.tensor([0])) for p in (picture, other))
    assert ((before - after)[..., :8, :8] != 0).any(1).all()


@torch.no_grad()
def test_what_is_said_of_an_item_hangs_on_its_category() -> None:
    torch.manual_seed(0)
    network = PictureNetwork(CHANNELS, CATEGORIES, 4).eval()
    answers = network(pictures(1).expand(CATEGORIES, -1, -1, -1), torch.eye(CATEGORIES))
    assert answers.shape == (CATEGORIES, 4)
    assert len(answers.unique(dim=0)) == CATEGORIES


@torch.no_grad()
def test_of_another_category_the_same_latent_is_another_size() -> None:
    torch.manual_seed(0)
    sizes = SizeNetwork(CHANNELS, CATEGORIES).decode(torch.zeros(CATEGORIES, LATENT), torch.eye(CATEGORIES))
    assert sizes.shape == (CATEGORIES, 2)
    assert len(sizes.unique(dim=0)) == CATEGORIES


@torch.no_grad()
def test_sizes_are_positive_and_drawn_by_the_generator_alone() -> None:
    torch.manual_seed(0)
    network = SizeNetwork(CHANNELS, CATEGORIES).eval()
    seen = pictures(6), torch.eye(CATEGORIES).repeat(2, 1)

    def sizes(seed: int | None) -> Tensor:
        return network(*seen, None if seed is None else torch.Generator().manual_seed(seed))

    assert sizes(None).shape == (6, 2)
    assert (sizes(None) > 0).all()
    assert torch.equal(sizes(None), sizes(None))
    assert torch.equal(sizes(1), sizes(1))
    assert not torch.equal(sizes(1), sizes(2))


@given(st.floats(0.05, 1.9), st.floats(0.05, 1.9), st.integers(0, SIDE**2 - 1))
def test_the_signed_distance_is_shapelys(width: float, height: float, pixel: int) -> None:
    box = shapely.box(-width / 2, -height / 2, width / 2, height / 2)
    row, column = divmod(pixel, SIDE)
    point = shapely.Point((column + 0.5) * 2 / SIDE - 1, (row + 0.5) * 2 / SIDE - 1)
    sign = -1 if box.contains(point) else 1
    found = signed_distance(torch.tensor([[width, height]]))[0, 0, row, column]
    np.testing.assert_allclose(found, sign * box.exterior.distance(point), atol=2e-6)
