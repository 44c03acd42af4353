// The fixed grid as cubes: those that can be seen, cut open where somebody wants to look inside.

import type { Cells } from "firn-client";
import { BoxGeometry, DataTexture } from "three";
import type { Cut } from "../session/look.ts";
import type { Picture } from "../session/picture.ts";
import { GROUND, type Solid, Solids, WHITE } from "./solids.ts";
import { mapTexture, onScale } from "./tint.ts";

const AXES = ["x", "y", "z"];

/** A plane across an axis (x, y and z are 0, 1 and 2) at a place on it [m]; what lies beyond is hidden. */
export interface Plane {
  axis: number;
  place: number;
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
    this.solids.show([...this.visible(picture, this.before(picture.cells, plane))]);
  }

  /** Which cells lie on the side of a plane that is shown. */
  private before({ origin }: Cells, plane: Plane | null): (x: number, y: number, z: number) => boolean {
    if (!plane) return () => true;
    const first = [origin.column_x, origin.cell_y, origin.column_z][plane.axis] as number;
    const end = plane.place / this.size - first - 0.5;
    return (...cell) => (cell[plane.axis] as number) < end;
  }

  private *visible(picture: Picture, shown: (x: number, y: number, z: number) => boolean): Generator<Solid> {
    const { cells, field, values, range } = picture;
    const { width, height, depth, origin, content } = cells;
    const fill = cells.fields.fill ?? [];
    const at = (x: number, y: number, z: number) => x + width * (y + height * z);
    /** Whether a cell hides what lies behind it. */
    const covers = (x: number, y: number, z: number) =>
      x >= 0 && y >= 0 && z >= 0 && x < width && y < height && z < depth && shown(x, y, z) && isFull(at(x, y, z));
    const isFull = (i: number) => content[i] === "ground" || (content[i] === "snow" && (fill[i] ?? 0) > 0.99);
    const { size } = this;
    for (let z = 0; z < depth; z++) {
      for (let y = 0; y < height; y++) {
        for (let x = 0; x < width; x++) {
          const i = at(x, y, z);
          if (content[i] === "air" || !shown(x, y, z)) continue;
          const hidden =
            covers(x, y + 1, z) &&
            covers(x - 1, y, z) &&
            covers(x + 1, y, z) &&
            covers(x, y, z - 1) &&
            covers(x, y, z + 1);
          if (hidden) continue;
          const tall = size * (content[i] === "ground" ? 1 : (fill[i] ?? 1));
          yield {
            centre: [
              (origin.column_x + x + 0.5) * size,
              (origin.cell_y + y) * size + tall / 2,
              (origin.column_z + z + 0.5) * size,
            ],
            extent: [size, tall, size],
            value: content[i] === "ground" ? GROUND : field ? onScale(values[i] as number, range) : WHITE,
          };
        }
      }
    }
  }
}

/** Where a cut goes through some cells of a size [m]: between two layers of them. */
export function planeOf({ origin, width, height, depth }: Cells, { axis, at }: Cut, size: number): Plane {
  const number = AXES.indexOf(axis);
  const first = [origin.column_x, origin.cell_y, origin.column_z][number] as number;
  const shown = Math.max(1, Math.round(at * ([width, height, depth][number] as number)));
  return { axis: number, place: (first + shown) * size };
}

/** The topmost snow's value of each column. */
export function topValues({ cells, values }: Picture): Float32Array {
  const { width, height, depth, content } = cells;
  const tops = new Float32Array(width * depth).fill(Number.NaN);
  for (let z = 0; z < depth; z++) {
    for (let x = 0; x < width; x++) {
      for (let y = height - 1; y >= 0; y--) {
        const i = x + width * (y + height * z);
        if (content[i] !== "snow") continue;
        tops[z * width + x] = values[i] as number;
        break;
      }
    }
  }
  return tops;
}
