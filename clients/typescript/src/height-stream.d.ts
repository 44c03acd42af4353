/** What is wrong with a message, and at which byte. */
export class DecodeError extends Error {
  readonly at: number;
}

/** Heights of a tile; tiles of one run share their `heights`: copy before you change them. */
export interface Tile {
  /** First column along x and along z. */
  column_x: number;
  column_z: number;
  /** Samples along x and along z, 1 to 8. */
  width: number;
  depth: number;
  /** Snow depths in quanta, row by row: index = z · width + x. */
  heights: Uint32Array;
}

/** A collider, as REST describes it. */
export interface Collider {
  id: string;
  mass: number;
  shape: { type: "box"; width: number; depth: number } | { type: "disk"; radius: number };
  position: { x: number; z: number };
  bottom: number;
  sink_depth: number;
  contact_area: number;
  pressure: number;
  resting: boolean;
}

/** A message of heights, or a part of one. */
export interface HeightMessage {
  op: "snapshot" | "delta";
  /** The subscription. */
  id: number;
  seq: number;
  tick: number;
  /** Whether you got exactly what you had missed; in the first answer after `resume` only. */
  recovered: boolean | null;
  /** Whether further parts of this message follow. */
  more: boolean;
  /** Every how many columns one is told. */
  stride: number;
  tiles: Tile[];
  /** All colliders in the region where they are told; they replace those told before. */
  colliders: Collider[] | null;
}

/** Reads a binary message of `firn.v1.bin`. Throws a DecodeError on anything else. */
export function decode(data: Uint8Array | ArrayBuffer): HeightMessage;
