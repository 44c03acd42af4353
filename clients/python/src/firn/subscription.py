"""What a stream's client watches, and what it holds of it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from .codec import GROUND_STEPS_PER_METRE, GroundTile, HeightMessage, Tile
from .types import Collider, ColumnRegion, DepthWatch, EventKind, Welcome

SIDE = 8


@dataclass
class Change:
    """What has changed in a subscription since the last one that was asked for."""

    tick: int = 0
    seq: int = 0
    """Number of the state. It only grows, and may exceed 32 bits."""
    parts: list[tuple[slice, slice]] = field(default_factory=list)
    """Where heights changed: `subscription.heights[part]` for each."""
    ground: bool = False
    """Whether the ground was told, of new parts of the region or because it changed."""
    colliders: bool = False
    """Whether the objects changed."""
    recovered: bool | None = None
    """After a lost connection: whether exactly what was missed was sent, or everything anew."""


class Subscription:
    """Keeps the heights of a region in sync. Made by `Stream.subscribe`.

    `async for change in subscription` tells what has changed; who is slow to ask gets several changes as one.
    """

    def __init__(self, id: int, wish: dict[str, Any], tell: Callable[[dict[str, Any]], Any]) -> None:
        self.id = id
        self.heights: NDArray[np.float64] = np.empty((0, 0))
        """Snow depths [m], shape (depth, width): `heights[z, x]`. NaN where nothing is known yet."""
        self.ground: NDArray[np.float64] | None = None
        """Elevations of the ground [m], as `heights`; None where the subscription does not want them."""
        self.column_x = 0
        """First column along x. Regions are widened to whole tiles of 8 × 8 columns."""
        self.column_z = 0
        """First column along z."""
        self.colliders: list[Collider] = []
        """The objects in the region, where they were asked for."""
        self.tick = 0
        self.seq = 0
        """The newest state that was told in full; 0 before the first."""
        self.stride: int = wish["stride"]
        """Columns from one sample to the next."""
        self._wish = wish
        self._tell = tell
        self._grid = (0, 0)
        self._epoch = ""
        self._seen: tuple[str, int] | None = None
        self._parts: list[HeightMessage] = []
        self._news: Change | None = None
        self._ended: Exception | None = None
        self._turn = asyncio.Event()

    async def move(self, region: ColumnRegion | None) -> None:
        """Looks at another region, all columns where there is none; only what comes into view is sent.

        What is known of it is in `heights` at once, the rest is NaN until it comes.
        """
        if region is not None and not self._meets_grid(region):
            raise ValueError(f"{region} meets none of the grid's {self._grid[0]} × {self._grid[1]} columns")
        self._wish["region"] = region
        self._look_at(region)
        await self._tell({"op": "update", "id": self.id, "region": region})

    async def want(
        self, *, events: bool | Sequence[EventKind] | None = None, watch: Sequence[DepthWatch] | None = None
    ) -> None:
        """Wants other events, or other watches; how these stand is told at once. What is None stays."""
        changes: dict[str, Any] = {}
        if events is not None:
            changes["events"] = as_json(events)
        if watch is not None:
            changes["watch"] = list(watch)
        self._wish |= changes
        await self._tell({"op": "update", "id": self.id, "region": self._wish["region"], **changes})

    async def _first(self) -> None:
        """Waits until the heights are known."""
        while self.seq == 0 and self._ended is None:
            self._turn.clear()
            await self._turn.wait()
        if self.seq == 0 and self._ended is not None:
            raise self._ended

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> Change:
        while self._news is None:
            if self._ended is not None:
                raise self._ended
            self._turn.clear()
            await self._turn.wait()
        change, self._news = self._news, None
        return change

    def _begin(self, welcome: Welcome) -> dict[str, Any]:
        """What to send once the stream is open. Who holds all of the region asks for what it missed only."""
        self._parts = []
        grid = (welcome["grid"]["width"], welcome["grid"]["depth"])
        if grid != self._grid:
            self._grid = grid
            self.heights = np.empty((0, 0))
            self.ground = None
            self._look_at(self._wish["region"])
        resume = None
        if self._seen is not None and not np.isnan(self.heights).any():
            # The epoch is that of the connection on which the state was told, whatever this one's is.
            resume = dict(zip(("epoch", "seq"), self._seen, strict=True))
        self._epoch = welcome["epoch"]
        return {"op": "subscribe", "id": self.id, **self._wish, "resume": resume}

    def _meets_grid(self, region: ColumnRegion) -> bool:
        x, z = region["column_x"], region["column_z"]
        spans = ((x, region["width"], self._grid[0]), (z, region["depth"], self._grid[1]))
        return all(count > 0 and first < columns and first + count > 0 for first, count, columns in spans)

    def _look_at(self, region: ColumnRegion | None) -> None:
        grid_width, grid_depth = self._grid
        wanted = region or {"column_x": 0, "column_z": 0, "width": grid_width, "depth": grid_depth}
        x0, x1 = _widened(wanted["column_x"], wanted["width"], grid_width)
        z0, z1 = _widened(wanted["column_z"], wanted["depth"], grid_depth)
        heights, ground, old_x, old_z = self.heights, self.ground, self.column_x, self.column_z
        self.column_x, self.column_z = x0, z0
        self.heights = np.full((-(-(z1 - z0) // self.stride), -(-(x1 - x0) // self.stride)), np.nan)
        if self._news is not None:
            self._news.parts = []
        self._put(old_x, old_z, heights, self.heights)
        if self._wish.get("terrain"):
            self.ground = np.full_like(self.heights, np.nan)
            if ground is not None:
                self._put(old_x, old_z, ground, self.ground)

    def _put(
        self, column_x: int, column_z: int, samples: NDArray[np.float64], into: NDArray[np.float64]
    ) -> tuple[slice, slice] | None:
        """Takes samples over as far as they lie in the region; where they do."""
        x, z = (column_x - self.column_x) // self.stride, (column_z - self.column_z) // self.stride
        depth, width = samples.shape
        z0, z1 = max(z, 0), min(z + depth, into.shape[0])
        x0, x1 = max(x, 0), min(x + width, into.shape[1])
        if z0 >= z1 or x0 >= x1:
            return None
        part = (slice(z0, z1), slice(x0, x1))
        into[part] = samples[z0 - z : z1 - z, x0 - x : x1 - x]
        return part

    def _take(self, message: HeightMessage) -> None:
        """Takes in a message, or a part of one: it counts once its last part is there."""
        self._parts.append(message)
        if message.more:
            return
        parts, self._parts = self._parts, []
        if message.op == "snapshot":
            self.heights.fill(np.nan)
        changed = [self._put_tile(tile) for part in parts for tile in part.tiles]
        ground_told = self._put_ground(parts)
        told = [part.colliders for part in parts if part.colliders is not None]
        if told:
            self.colliders = [collider for some in told for collider in some]
        self.tick, self.seq = message.tick, message.seq
        self._seen = (self._epoch, self.seq)
        news = self._news or Change()
        known = {(z.start, x.start): (z, x) for z, x in news.parts}
        known |= {(part[0].start, part[1].start): part for part in changed if part is not None}
        self._news = Change(
            tick=self.tick,
            seq=self.seq,
            parts=list(known.values()),
            ground=news.ground or ground_told,
            colliders=news.colliders or bool(told),
            recovered=parts[0].recovered if parts[0].recovered is not None else news.recovered,
        )
        self._turn.set()

    def _put_tile(self, tile: Tile) -> tuple[slice, slice] | None:
        # Divided by quanta per metre, 4685 quanta of a millimetre are 4.685, as written.
        return self._put(tile.column_x, tile.column_z, tile.heights / (1 / self._wish["quantum"]), self.heights)

    def _put_ground(self, parts: list[HeightMessage]) -> bool:
        """Takes over the ground, where it is told; whether it is."""
        if self.ground is None:
            return False
        level = any(part.level for part in parts)
        if level:
            self.ground.fill(0)
        tiles: list[GroundTile] = [tile for part in parts for tile in part.terrain]
        for tile in tiles:
            self._put(tile.column_x, tile.column_z, tile.heights / GROUND_STEPS_PER_METRE, self.ground)
        return level or bool(tiles)

    def _end(self, why: Exception) -> None:
        self._ended = self._ended or why
        self._turn.set()


def as_json(events: bool | Sequence[EventKind]) -> bool | list[EventKind]:
    """Which events are wanted, as they are sent."""
    return events if isinstance(events, bool) else list(events)


def _widened(first: int, count: int, columns: int) -> tuple[int, int]:
    """Part of an axis, widened to whole tiles and clipped to the grid."""
    begin = max(0, first // SIDE * SIDE)
    return begin, max(begin, min(columns, -(-(first + count) // SIDE) * SIDE))
