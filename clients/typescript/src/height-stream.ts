// Decoder of the binary messages of the height stream, sub-protocol `firn.v1.bin`; api/height-stream.md describes the bytes.

import type { Collider } from "./types.ts";

/** What is wrong with a message, and at which byte. */
export class DecodeError extends Error {
  readonly at: number;

  constructor(at: number, what: string) {
    super(`byte ${at}: ${what}`);
    this.name = "DecodeError";
    this.at = at;
  }
}

/** Heights of a tile; tiles of one run share their `heights`: copy before you change them. */
export interface Tile {
  /** First column along x. */
  column_x: number;
  /** First column along z. */
  column_z: number;
  /** Samples along x, 1 to 8. */
  width: number;
  /** Samples along z, 1 to 8. */
  depth: number;
  /** Snow depths in quanta, row by row: index = z · width + x. */
  heights: Uint32Array;
}

/** Ground of a tile; tiles of one run share it, as heights. */
export interface GroundTile extends Omit<Tile, "heights"> {
  /** Elevations in tenths of a millimetre, row by row, as heights. */
  heights: Int32Array;
}

/** Steps that elevations of the ground are told in, of each metre. */
export const GROUND_STEPS_PER_METRE = 10_000;

/** A message of heights, or a part of one. */
export interface HeightMessage {
  op: "snapshot" | "delta";
  /** The subscription. */
  id: number;
  /** Number of the state. It only grows, and may exceed 32 bits; exact up to 2^53 - 1, and no message has a higher one. */
  seq: number;
  tick: number;
  /** Whether you got exactly what you had missed; told in the first answer after `resume` only. */
  recovered: boolean | null;
  /** Whether further parts of this message follow. */
  more: boolean;
  /** Every how many columns one is told. */
  stride: number;
  tiles: Tile[];
  /** Whether all ground is level at 0, but what the message tells. */
  level: boolean;
  /** Tiles of the ground, where a subscription wants it and it is told. */
  terrain: GroundTile[];
  /** All colliders in the region where they are told; they replace those told before. */
  colliders: Collider[] | null;
}

const SIDE = 8;

class Reader {
  readonly bytes: Uint8Array;
  at = 0;

  constructor(bytes: Uint8Array) {
    this.bytes = bytes;
  }

  wrong(what: string): DecodeError {
    return new DecodeError(Math.max(this.at - 1, 0), what);
  }

  take(count: number): Uint8Array {
    const end = this.at + count;
    if (end > this.bytes.length) throw new DecodeError(this.bytes.length, "the message ends too early");
    const taken = this.bytes.subarray(this.at, end);
    this.at = end;
    return taken;
  }

  byte(): number {
    return this.take(1)[0];
  }

  big(): bigint {
    let value = 0n;
    for (let shift = 0n; shift < 64n; shift += 7n) {
      const byte = this.byte();
      value |= BigInt(byte & 0x7f) << shift;
      if (shift === 63n && (byte & 0x7f) > 1) break;
      if ((byte & 0x80) === 0) return value;
    }
    throw this.wrong("a number has more than 64 bits");
  }

  /** A number that counts something: exact up to 2^53. */
  number(): number {
    const value = this.big();
    if (value > BigInt(Number.MAX_SAFE_INTEGER)) throw this.wrong("a number has more than 53 bits");
    return Number(value);
  }

  u32(): number {
    const value = this.big();
    if (value > 0xffffffffn) throw this.wrong("a number has more than 32 bits");
    return Number(value);
  }
}

type Head = Omit<HeightMessage, "tiles" | "terrain" | "colliders">;

function readHead(reader: Reader): { head: Head; tilesX: number; flags: number } {
  const kind = reader.byte();
  if (kind !== 1 && kind !== 2) throw reader.wrong("neither 1, a snapshot, nor 2, a delta");
  const flags = reader.byte();
  if ((flags & 6) === 4) throw reader.wrong("these flags have no meaning");
  const code = reader.big();
  const id = Number((code >> 1n) ^ -(code & 1n));
  const head: Head = {
    op: kind === 1 ? "snapshot" : "delta",
    id,
    seq: reader.number(),
    tick: reader.number(),
    recovered: (flags & 2) !== 0 ? (flags & 4) !== 0 : null,
    more: (flags & 1) !== 0,
    level: (flags & 0x80) !== 0,
    stride: 1 << ((flags >> 4) & 3),
  };
  const tilesX = reader.u32();
  if (tilesX === 0) throw reader.wrong("a grid has at least one tile in a row");
  return { head, tilesX, flags };
}

function readRow(reader: Reader, heights: Uint32Array, begin: number, width: number, base: number): void {
  const code = reader.byte();
  const bits = (code & 31) === 31 ? 32 : code & 31;
  const predictor = (code >> 5) & 3;
  if (predictor === 3) throw reader.wrong("there is no such predictor");
  const all = (1 << width) - 1;
  const there = (code & 0x80) !== 0 ? reader.byte() : all;
  if ((there & ~all) !== 0) throw reader.wrong("a residual is beyond the row");
  let count = 0;
  for (let x = 0; x < width; x++) count += (there >> x) & 1;
  const bytes = reader.take(Math.ceil((count * bits) / 8));
  const above = (x: number) => (begin === 0 ? base : heights[begin - width + x]);
  let bit = 0;
  for (let x = 0; x < width; x++) {
    let residual = 0;
    if ((there >> x) & 1) {
      for (let i = 0; i < bits; i++, bit++) residual |= ((bytes[bit >> 3] >> (bit & 7)) & 1) << i;
    }
    const difference = (residual >>> 1) ^ -(residual & 1);
    let guess = above(x);
    if (x > 0 && predictor === 0) guess = heights[begin + x - 1];
    if (x > 0 && predictor === 2) guess = heights[begin + x - 1] + above(x) - above(x - 1);
    // Stored modulo 2^32.
    heights[begin + x] = guess + difference;
  }
}

type Samples = Pick<Tile, "width" | "depth" | "heights">;

function readTile(reader: Reader, stride: number): Samples {
  const flags = reader.byte();
  if ((flags & ~3) !== 0) throw reader.wrong("these flags of a tile have no meaning");
  let width = SIDE / stride;
  let depth = width;
  if ((flags & 2) !== 0) {
    const size = reader.byte();
    if (size >= SIDE * SIDE) throw reader.wrong("a tile has at most 8 samples along a side");
    width = (size % SIDE) + 1;
    depth = (size >> 3) + 1;
  }
  const base = reader.u32();
  const heights = new Uint32Array(width * depth).fill(base);
  if ((flags & 1) === 0) return { width, depth, heights };
  const coded = reader.byte();
  if (coded >> depth !== 0) throw reader.wrong("a row is beyond the tile");
  for (let z = 0; z < depth; z++) {
    const begin = z * width;
    if ((coded >> z) & 1) readRow(reader, heights, begin, width, base);
    else if (z > 0) heights.copyWithin(begin, begin - width, begin);
  }
  return { width, depth, heights };
}

/** Reads runs of tiles, of snow or of ground. */
function readTiles(reader: Reader, stride: number, tilesX: number): Tile[] {
  const tiles: Tile[] = [];
  const put = (place: number, tile: Samples) =>
    tiles.push({ column_x: (place % tilesX) * SIDE, column_z: Math.floor(place / tilesX) * SIDE, ...tile });
  let place = 0;
  for (let left = reader.number(); left > 0; left--) {
    place += reader.u32();
    const code = reader.number();
    const count = Math.floor(code / 2);
    // No server sends more tiles than a grid can hold. A false count must not fill the memory.
    if (count === 0 || place + count > 2 ** 24) throw reader.wrong("a run has 1 to 2^24 tiles");
    const end = place + count;
    if (code % 2 === 1) {
      const tile = readTile(reader, stride);
      for (; place < end; place++) put(place, tile);
    } else {
      for (; place < end; place++) put(place, readTile(reader, stride));
    }
  }
  return tiles;
}

/** Reads a message; heights are in quanta of the subscription. Throws a DecodeError on anything else. */
export function decode(data: Uint8Array | ArrayBuffer): HeightMessage {
  const reader = new Reader(data instanceof Uint8Array ? data : new Uint8Array(data));
  const { head, tilesX, flags } = readHead(reader);
  const tellsColliders = (flags & 8) !== 0;
  const tiles = readTiles(reader, head.stride, tilesX);
  const ground = (flags & 0x40) !== 0 ? readTiles(reader, head.stride, tilesX) : [];
  // The same 32 bits, with a sign.
  const terrain = ground.map((tile) => ({ ...tile, heights: new Int32Array(tile.heights.buffer) }));
  const rest = reader.take(reader.bytes.length - reader.at);
  if (!tellsColliders && rest.length > 0) throw reader.wrong("there are bytes after the last tile");
  let colliders: Collider[] | null = null;
  if (tellsColliders) {
    try {
      colliders = JSON.parse(new TextDecoder("utf-8", { fatal: true }).decode(rest));
    } catch {
      throw reader.wrong("the colliders are not JSON in UTF-8");
    }
  }
  return { ...head, tiles, terrain, colliders };
}
