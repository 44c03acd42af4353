"""The decoder against the test vectors that all decoders share."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from firn import DecodeError, GroundTile, Tile, decode
from server import ROOT

VECTORS = json.loads((ROOT / "api/height-stream-vectors.json").read_text())


@pytest.mark.parametrize("vector", VECTORS["messages"], ids=lambda vector: vector["name"])
def test_a_message_says_what_it_should(vector: dict[str, Any]) -> None:
    message = decode(bytes.fromhex(vector["hex"]))
    said = {name: getattr(message, name) for name in vector["message"]}
    said |= {"tiles": as_json(message.tiles), "terrain": as_json(message.terrain)}
    assert said == vector["message"]


def as_json(tiles: Sequence[Tile | GroundTile]) -> list[dict[str, Any]]:
    return [
        {
            "column_x": tile.column_x,
            "column_z": tile.column_z,
            "width": tile.heights.shape[1],
            "depth": tile.heights.shape[0],
            "heights": tile.heights.ravel().tolist(),
        }
        for tile in tiles
    ]


@pytest.mark.parametrize("vector", VECTORS["wrong"], ids=lambda vector: vector["name"])
def test_anything_else_is_refused(vector: dict[str, Any]) -> None:
    with pytest.raises(DecodeError):
        decode(bytes.fromhex(vector["hex"]))


def test_a_message_cut_anywhere_is_refused_or_read_never_worse() -> None:
    random = np.random.default_rng(1)
    for vector in VECTORS["messages"]:
        data = bytes.fromhex(vector["hex"])
        for end in range(len(data)):
            with pytest.raises(DecodeError):
                decode(data[:end])
        for _ in range(300):
            broken = bytearray(data)
            broken[random.integers(len(data))] = random.integers(256)
            try:
                decode(bytes(broken[:200]))
            except DecodeError as error:
                assert 0 <= error.at <= len(data)
