"""PlanIT's image networks, smaller: where an item goes, which way it faces, how large it is (Wang et al. 2019, 6)."""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn.functional import interpolate, leaky_relu, softplus

from layoutrl.rivals.planit.graph import TYPES

SIDE = 64  # pixels a side of the pictures that they see
HEAT_SIDE = 64  # pixels a side of the location network's output
EMBEDDING = 10  # dimensions in which a type of edge is embedded
LATENT = 10
WIDTHS = (32, 64, 128, 256)  # channels of the location network's encoder; PlanIT's is twice as wide and deep
UP_WIDTHS = (256, 128, 64, 32, 16, 8, 8)  # and of its decoder


class Residual(nn.Module):
    """Two convolutions beside a shortcut."""

    def __init__(self, before: int, after: int, stride: int):
        super().__init__()
        self.body = nn.Sequential(
            nn.Conv2d(before, after, 3, stride, 1, bias=False),
            nn.BatchNorm2d(after),
            nn.LeakyReLU(),
            nn.Conv2d(after, after, 3, 1, 1, bias=False),
            nn.BatchNorm2d(after),
        )
        same = before == after and stride == 1
        self.shortcut = nn.Identity() if same else nn.Conv2d(before, after, 1, stride, bias=False)

    def forward(self, x: Tensor) -> Tensor:
        """(B, before, height, width) to (B, after, ...), smaller by the stride."""
        return leaky_relu(self.body(x) + self.shortcut(x))


class Upwards(nn.Module):
    """Upsampling by 2 and a convolution, scaled and shifted by the type of the edge (FiLM)."""

    def __init__(self, before: int, after: int, coordinates: bool):
        super().__init__()
        self.coordinates = coordinates
        self.convolution = nn.Conv2d(before + 3 * coordinates, after, 3, 1, 1, bias=False)
        self.normalise = nn.BatchNorm2d(after)
        self.film = nn.Linear(EMBEDDING, 2 * after)

    def forward(self, x: Tensor, edge: Tensor) -> Tensor:
        """Features (B, before, side, side), embedded edges (B, EMBEDDING) to (B, after, 2 side, 2 side)."""
        x = interpolate(x, scale_factor=2, mode="nearest")
        if self.coordinates:  # x, y and the distance from the middle (CoordConv)
            axis = torch.linspace(-1, 1, x.shape[-1], device=x.device)
            rows, columns = torch.meshgrid(axis, axis, indexing="ij")
            where = torch.stack([columns, rows, torch.hypot(columns, rows)])
            x = torch.cat([x, where.expand(len(x), -1, -1, -1)], 1)
        scale, shift = self.film(edge)[..., None, None].chunk(2, 1)
        return leaky_relu(self.normalise(self.convolution(x)) * (1 + scale) + shift)


class LocationNetwork(nn.Module):
    """Classifies each pixel of a picture centred on an anchor: to what an edge of the given type leads there.

    (B, channels, 64, 64), (B,) -> logits (B, 1 + categories, 64, 64); class 0 is nothing. As in PlanIT all passes
    through a single pixel, so that outputs are blurred.
    """

    def __init__(self, channels: int, categories: int):
        super().__init__()
        first = WIDTHS[0]
        layers: list[nn.Module] = [
            nn.Conv2d(channels, first, 7, 2, 3, bias=False),
            nn.BatchNorm2d(first),
            nn.LeakyReLU(),
            nn.MaxPool2d(3, 2, 1),
            Residual(first, first, 1),
        ]
        for before, after in pairwise(WIDTHS):
            layers += [Residual(before, after, 2), Residual(after, after, 1)]
        self.inwards = nn.Sequential(*layers, nn.AdaptiveAvgPool2d(1))
        self.embedding = nn.Embedding(len(TYPES), EMBEDDING)
        self.upwards = nn.ModuleList(
            Upwards(before, after, coordinates=k >= 2) for k, (before, after) in enumerate(pairwise(UP_WIDTHS))
        )
        self.classes = nn.Conv2d(UP_WIDTHS[-1], 1 + categories, 1)

    def forward(self, picture: Tensor, edge: Tensor) -> Tensor:
        """Logits of each pixel's class (B, 1 + categories, height, width), of pictures and the types (B,) of edges."""
        x, embedded = self.inwards(picture), self.embedding(edge)
        for block in self.upwards:
            x = block(x, embedded)
        return self.classes(x)


class PictureNetwork(nn.Module):
    """A CNN on a picture centred on an item and its one-hot category: (B, channels, 64, 64), (B, C) -> (B, outputs)."""

    def __init__(self, channels: int, categories: int, outputs: int):
        super().__init__()
        widths = (channels, 8, 16, 32, 64)
        layers = [
            nn.Sequential(nn.Conv2d(before, after, 4, 2, 1), nn.BatchNorm2d(after), nn.LeakyReLU())
            for before, after in pairwise(widths)
        ]
        self.features = nn.Sequential(*layers, nn.Flatten())
        self.head = nn.Sequential(nn.Linear(64 * 16 + categories, 64), nn.LeakyReLU(), nn.Linear(64, outputs))

    def forward(self, picture: Tensor, category: Tensor) -> Tensor:
        """Outputs (B, outputs), of pictures (B, channels, 64, 64) and categories as one-hot (B, C)."""
        return self.head(torch.cat([self.features(picture), category], 1))


class SizeNetwork(nn.Module):
    """A VAE of an item's size, in units of the picture's reach, conditioned on the picture and the category.

    It is trained with a discriminator. Categories are one-hot (B, C).
    """

    def __init__(self, channels: int, categories: int):
        super().__init__()
        self.prior = PictureNetwork(channels, categories, 2 * LATENT)
        self.encoder = PictureNetwork(channels + 1, categories, 2 * LATENT)
        self.decoder = nn.Sequential(
            nn.Linear(LATENT + categories, 40), nn.LeakyReLU(), nn.Linear(40, 40), nn.LeakyReLU(), nn.Linear(40, 2)
        )

    def decode(self, latent: Tensor, category: Tensor) -> Tensor:
        """Return sizes (B, 2): along the way that the item faces, and across."""
        return softplus(self.decoder(torch.cat([latent, category], 1)))

    def forward(self, picture: Tensor, category: Tensor, generator: torch.Generator | None) -> Tensor:
        """Return sizes (B, 2) drawn by the generator, or without one those of the prior's mean."""
        mean, spread = self.prior(picture, category).chunk(2, 1)
        if generator is not None:
            mean = drawn(mean, spread, generator)
        return self.decode(mean, category)


def drawn(mean: Tensor, log_variance: Tensor, generator: torch.Generator) -> Tensor:
    """A sample of a normal distribution, through which gradients pass."""
    noise = torch.randn(mean.shape, generator=generator, device=mean.device)
    return mean + noise * (log_variance / 2).exp()


def signed_distance(size: Tensor) -> Tensor:
    """How far each pixel is from a box of this size (B, 2) in the middle, negative within: (B, 1, 64, 64)."""
    axis = (torch.arange(SIDE, device=size.device) + 0.5) * 2 / SIDE - 1
    far = torch.stack(torch.meshgrid(axis, axis, indexing="xy")).abs() - size[:, :, None, None] / 2
    outside = (far.clamp(min=0).square().sum(1) + 1e-12).sqrt()
    return (outside + far.amax(1).clamp(max=0))[:, None]
