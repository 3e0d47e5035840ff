"""Designed rooms whose main item moves."""

from __future__ import annotations

from functools import cache

from layoutrl.rooms.collection import Collection, choose_item
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import Room


@cache
def designed(room_type: str, count: int) -> list[Room]:
    rooms = design_rooms(room_type, "train", 5, count).rooms
    return choose_item(Collection("designer", rooms, inside=True), "main").rooms
