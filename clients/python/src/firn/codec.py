"""Decoder of the binary messages of the height stream, `firn.v1.bin`; api/height-stream.md describes the bytes.

The bytes are walked once, which tells where each row's residuals stand; then all rows of all tiles are decoded
together.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Literal, NoReturn

import numpy as np
from numpy.typing import NDArray

SIDE = 8
LEFT, ABOVE, NONE = 0, 1, 3
# Elevations of the ground are told in tenths of a millimetre.
GROUND_STEPS_PER_METRE = 10_000
# No server sends more tiles than a grid can hold. A false count must not fill the memory.
MOST_TILES = 1 << 24


class DecodeError(ValueError):
    """What is wrong with a message, and at which byte."""

    def __init__(self, at: int, what: str) -> None:
        super().__init__(f"byte {at}: {what}")
        self.at = at


@dataclass(frozen=True)
class Tile:
    """Heights of a tile. Tiles of one run share them: they can't be written to."""

    column_x: int
    """First column along x."""
    column_z: int
    """First column along z."""
    heights: NDArray[np.uint32]
    """Snow depths in quanta, shape (depth, width), at most 8 × 8."""


@dataclass(frozen=True)
class GroundTile:
    """Ground of a tile; shared as heights are."""

    column_x: int
    """First column along x."""
    column_z: int
    """First column along z."""
    heights: NDArray[np.int32]
    """Elevations in tenths of a millimetre, shape (depth, width), at most 8 × 8."""


@dataclass(frozen=True)
class HeightMessage:
    """A message of heights, or a part of one."""

    op: Literal["snapshot", "delta"]
    id: int
    """The subscription."""
    seq: int
    tick: int
    recovered: bool | None
    """Whether exactly what was missed was sent; in the first answer after `resume` only."""
    more: bool
    """Whether further parts follow."""
    stride: int
    tiles: list[Tile]
    level: bool
    """Whether all ground is level at 0, but what the message tells."""
    terrain: list[GroundTile]
    """Tiles of the ground, where a subscription wants it and it is told."""
    colliders: list[Any] | None
    """All objects in the region, where they are told; they replace those told before."""


def decode(data: bytes) -> HeightMessage:
    """Reads a message. Raises `DecodeError` for anything that api/height-stream.md doesn't describe."""
    reader = _Reader(data)
    kind = reader.byte()
    if kind not in (1, 2):
        reader.refuse("neither 1, a snapshot, nor 2, a delta")
    flags = reader.byte()
    if flags & 6 == 4:
        reader.refuse("these flags have no meaning")
    code = reader.varint(64)
    stride = 1 << (flags >> 4 & 3)
    seq, tick = reader.varint(64), reader.varint(64)
    tiles_x = reader.varint(32)
    if tiles_x == 0:
        reader.refuse("a grid has at least one tile in a row")
    tiles = _read_tiles(reader, stride, tiles_x)
    ground = _read_tiles(reader, stride, tiles_x) if flags & 0x40 else []
    rest = data[reader.at :]
    if rest and not flags & 8:
        reader.refuse("there are bytes after the last tile")
    return HeightMessage(
        op="snapshot" if kind == 1 else "delta",
        id=(code >> 1) ^ -(code & 1),
        seq=seq,
        tick=tick,
        recovered=bool(flags & 4) if flags & 2 else None,
        more=bool(flags & 1),
        stride=stride,
        tiles=tiles,
        level=bool(flags & 0x80),
        # The same 32 bits, with a sign.
        terrain=[GroundTile(tile.column_x, tile.column_z, tile.heights.view(np.int32)) for tile in ground],
        colliders=_colliders(reader, rest) if flags & 8 else None,
    )


def _colliders(reader: _Reader, text: bytes) -> list[Any]:
    try:
        colliders = json.loads(text.decode())
    except ValueError:
        colliders = None
    if not isinstance(colliders, list):
        reader.refuse("the colliders are no JSON array in UTF-8")
    return colliders


class _Reader:
    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = 0

    def refuse(self, what: str) -> NoReturn:
        raise DecodeError(max(self.at - 1, 0), what)

    def byte(self) -> int:
        if self.at >= len(self.data):
            raise DecodeError(len(self.data), "the message ends too early")
        self.at += 1
        return self.data[self.at - 1]

    def skip(self, count: int) -> int:
        """Passes over bytes; where they begin."""
        if self.at + count > len(self.data):
            raise DecodeError(len(self.data), "the message ends too early")
        self.at += count
        return self.at - count

    def varint(self, bits: int) -> int:
        value = shift = 0
        while True:
            byte = self.byte()
            value |= (byte & 0x7F) << shift
            if value >> bits:
                self.refuse(f"a number has more than {bits} bits")
            if byte < 0x80:
                return value
            shift += 7


class _Rows:
    """Where the coded rows of all tiles stand."""

    def __init__(self) -> None:
        self.bases: list[int] = []
        self.sizes: list[tuple[int, int]] = []
        # For each coded row: its tile, z, first byte, width of a residual in bits, predictor, samples with one.
        self.coded: list[tuple[int, int, int, int, int, int]] = []

    def read_tile(self, reader: _Reader, stride: int) -> int:
        """Walks over a tile; its number."""
        flags = reader.byte()
        if flags & ~3:
            reader.refuse("these flags of a tile have no meaning")
        width = depth = SIDE // stride
        if flags & 2:
            size = reader.byte()
            if size >= SIDE * SIDE:
                reader.refuse("a tile has at most 8 samples along a side")
            width, depth = size % SIDE + 1, size // SIDE + 1
        tile = len(self.bases)
        self.bases.append(reader.varint(32))
        self.sizes.append((depth, width))
        if flags & 1:
            coded = reader.byte()
            if coded >> depth:
                reader.refuse("a row is beyond the tile")
            for z in range(depth):
                if coded >> z & 1:
                    self._read_row(reader, tile, z, width)
        return tile

    def _read_row(self, reader: _Reader, tile: int, z: int, width: int) -> None:
        code = reader.byte()
        bits, predictor = code & 31, code >> 5 & 3
        if bits == 31:
            bits = 32
        if predictor == NONE:
            reader.refuse("there is no such predictor")
        there = reader.byte() if code & 0x80 else (1 << width) - 1
        if there >> width:
            reader.refuse("a residual is beyond the row")
        begin = reader.skip((there.bit_count() * bits + 7) // 8)
        self.coded.append((tile, z, begin, bits, predictor, there))

    def decode(self, data: bytes) -> NDArray[np.uint32]:
        """The heights of all tiles, shape (tiles, 8, 8); what is beyond a tile's size means nothing."""
        count = len(self.bases)
        residuals = np.zeros((count, SIDE, SIDE), np.uint32)
        # A row that is not coded equals the one above it.
        predictors = np.full((count, SIDE), ABOVE)
        if self.coded:
            tile, z, begin, bits, predictor, there = np.array(self.coded, np.int64).T
            residuals[tile, z] = _residuals(data, begin, bits, there)
            predictors[tile, z] = predictor
        heights = np.empty_like(residuals)
        above = np.repeat(np.array(self.bases, np.uint32)[:, None], SIDE, axis=1)
        for row in range(SIDE):
            steps, kind = residuals[:, row], predictors[:, row, None]
            # Modulo 2³², as uint32 is. Predictor 2 sums the differences from the row above.
            start = np.where(kind == LEFT, above[:, :1], above)
            above = start + np.where(kind == ABOVE, steps, np.cumsum(steps, axis=1, dtype=np.uint32))
            heights[:, row] = above
        heights.flags.writeable = False
        return heights


def _residuals(
    data: bytes, begin: NDArray[np.int64], bits: NDArray[np.int64], there: NDArray[np.int64]
) -> NDArray[np.uint32]:
    """Residuals of coded rows, shape (rows, 8); 0 where there is none."""
    is_there = (there[:, None] >> np.arange(SIDE)) & 1
    rank = np.cumsum(is_there, axis=1) - is_there
    position = begin[:, None] * 8 + rank * bits[:, None]
    # A residual of 32 bits that begins within a byte lies in five bytes.
    padded = np.frombuffer(data + bytes(8), np.uint8)
    window = padded[(position >> 3)[..., None] + np.arange(8)].view("<u8")[..., 0]
    mask = (np.uint64(1) << bits.astype(np.uint64)) - np.uint64(1)
    zigzag = (window >> (position & 7).astype(np.uint64)) & mask[:, None] * is_there.astype(np.uint64)
    halves = (zigzag >> np.uint64(1)).astype(np.uint32)
    residuals: NDArray[np.uint32] = np.where(zigzag & np.uint64(1), ~halves, halves)
    return residuals


def _read_tiles(reader: _Reader, stride: int, tiles_x: int) -> list[Tile]:
    """Reads runs of tiles, of snow or of ground."""
    rows = _Rows()
    placed: list[tuple[int, int]] = []
    place = 0
    for _ in range(reader.varint(32)):
        place += reader.varint(32)
        count, equal = divmod(reader.varint(64), 2)
        if count == 0 or place + count > MOST_TILES:
            reader.refuse("a run has 1 to 2²⁴ tiles")
        if equal:
            tile = rows.read_tile(reader, stride)
            placed += ((place + i, tile) for i in range(count))
        else:
            placed += ((place + i, rows.read_tile(reader, stride)) for i in range(count))
        place += count
    heights = rows.decode(reader.data)

    def cut(place: int, tile: int) -> Tile:
        depth, width = rows.sizes[tile]
        return Tile(place % tiles_x * SIDE, place // tiles_x * SIDE, heights[tile, :depth, :width])

    return [cut(place, tile) for place, tile in placed]
