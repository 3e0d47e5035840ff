"""Arrays as texts in the files of cells."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np

IOU, METRES, INDEX, FLAG = (np.dtype(kind) for kind in ("<u2", "<f4", "<u2", "u1"))  # of what is packed; IoU in 1/65535


def packed(values: Sequence[float] | np.ndarray, kind: np.dtype[Any]) -> str:
    """An array as text: compressed, in base64."""
    return base64.b64encode(zlib.compress(np.asarray(values).astype(kind).tobytes(), 9)).decode()


def unpacked(text: str, kind: np.dtype[Any]) -> np.ndarray:
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), kind)


def packed_iou(iou: np.ndarray) -> str:
    return packed(np.round(iou * 65535), IOU)


def unpacked_iou(text: str) -> np.ndarray:
    return unpacked(text, IOU) / 65535
