// The fixed grid as cubes on the ground: those that can be seen, cut open where somebody wants to look inside.

import { BoxGeometry, DataTexture } from "three";
import { extremes } from "../extremes.ts";
import type { Cut } from "../session/look.ts";
import type { Picture } from "../session/picture.ts";
import { GROUND, type Solid, Solids, WHITE } from "./solids.ts";
import { mapTexture, onScale } from "./tint.ts";

const AXES = ["x", "y", "z"];
/** A neighbour that is lower by less than this part of a cell hides a cell all the same. */
const HAIR = 0.01;
/** How far the ground that is drawn reaches below its lowest place, as a part of the longer side. */
export const PLINTH = 0.02;

/** A plane across an axis (x, y and z are 0, 1 and 2) at a place on it [m]; what lies beyond is hidden. */
export interface Plane {
  axis: number;
  place: number;
}

/** What is shown of each column, row by row. */
interface Stacks {
  /** Its cells of snow; −1 where nothing of it is shown. */
  counts: Int16Array;
  /** Elevations of the ground under it [m], and of its top. */
  grounds: Float32Array;
  tops: Float32Array;
}

/** The cubes. */
export class Cubes {
  readonly solids = new Solids(new BoxGeometry(1, 1, 1), true);
  private readonly size: number;
  private map: DataTexture | null = null;

  /** `size` is the side of a cell [m]. */
  constructor(size: number) {
    this.size = size;
    const white = new DataTexture(new Uint8Array([255, 255, 255, 255]), 1, 1);
    white.needsUpdate = true;
    this.solids.map = white;
  }

  /** Shows a picture up to a plane. */
  show(picture: Picture, plane: Plane | null): void {
    if (picture.field) {
      this.map?.dispose();
      this.map = mapTexture(picture.field);
      this.solids.map = this.map;
    }
    this.solids.show([...this.visible(picture, this.stack(picture, plane))]);
  }

  private stack({ cells, ground }: Picture, plane: Plane | null): Stacks {
    const { width, height, depth, origin, content } = cells;
    const { size } = this;
    const counts = new Int16Array(width * depth).fill(-1);
    const grounds = new Float32Array(width * depth);
    const tops = new Float32Array(width * depth).fill(Number.NEGATIVE_INFINITY);
    const ends = [0, 1, 2].map((axis) => (plane?.axis === axis ? plane.place : Number.POSITIVE_INFINITY));
    const [endX, endY, endZ] = ends as [number, number, number];
    for (let z = 0; z < depth; z++) {
      for (let x = 0; x < width; x++) {
        if ((origin.column_x + x + 0.5) * size > endX || (origin.column_z + z + 0.5) * size > endZ) continue;
        const column = z * width + x;
        const floor = ground?.[column] ?? 0;
        const cell = (y: number) => x + width * (y + height * z);
        let y = 0;
        while (y < height && content[cell(y)] === "snow" && floor + (y + 0.5) * size < endY) y++;
        counts[column] = y;
        grounds[column] = Math.min(floor, endY);
        const fill = y > 0 ? (cells.fields.fill?.[cell(y - 1)] ?? 1) : 1;
        tops[column] = y > 0 ? floor + (y - 1 + fill) * size : (grounds[column] as number);
      }
    }
    return { counts, grounds, tops };
  }

  private *visible(picture: Picture, { counts, grounds, tops }: Stacks): Generator<Solid> {
    const { cells, field, values, range } = picture;
    const { width, height, depth, origin } = cells;
    const { size } = this;
    const bottom = extremes(picture.ground)[0] - PLINTH * size * Math.max(width, depth);
    const topAt = (x: number, z: number) =>
      x >= 0 && z >= 0 && x < width && z < depth ? (tops[z * width + x] as number) : Number.NEGATIVE_INFINITY;
    for (let z = 0; z < depth; z++) {
      for (let x = 0; x < width; x++) {
        const column = z * width + x;
        const [count, ground] = [counts[column] as number, grounds[column] as number];
        // Up to here the neighbours hide the sides.
        const hidden = Math.min(topAt(x - 1, z), topAt(x + 1, z), topAt(x, z - 1), topAt(x, z + 1)) + HAIR * size;
        const solid = (low: number, high: number, value: number): Solid => ({
          centre: [(origin.column_x + x + 0.5) * size, (low + high) / 2, (origin.column_z + z + 0.5) * size],
          extent: [size, high - low, size],
          value,
        });
        if (count === 0 || (count > 0 && hidden < ground)) yield solid(bottom, ground, GROUND);
        for (let y = 0; y < count; y++) {
          const low = ground + y * size;
          const high = y + 1 < count ? low + size : (tops[column] as number);
          if (y + 1 < count && hidden >= high) continue;
          const value = values[x + width * (y + height * z)] as number;
          yield solid(low, high, field ? onScale(value, range) : WHITE);
        }
      }
    }
  }
}

/** Where a cut goes through some cells of a size [m]: between two layers of them. */
export function planeOf({ cells, ground }: Picture, { axis, at }: Cut, size: number): Plane {
  const { origin, width, height, depth } = cells;
  const [lowest, highest] = extremes(ground);
  const number = AXES.indexOf(axis);
  const first = [origin.column_x * size, lowest, origin.column_z * size][number] as number;
  const count = [width, height + (highest - lowest) / size, depth][number] as number;
  return { axis: number, place: first + Math.max(1, Math.round(at * count)) * size };
}
