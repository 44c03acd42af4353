// Snow on its ground: how high it is where.

import type { HeightField } from "firn-client";
import { groundAt } from "../scene/relief.ts";

/** Heights, and the ground under each of their samples above the lowest [m]; null where it is level. */
export interface Laid {
  field: HeightField;
  ground: Float32Array | null;
}

/** The elevation at a place [m], between the four samples around it. */
export function elevationIn(laid: Laid, x: number, z: number): number {
  const { field } = laid;
  const [left, part] = between(x, field.column_x, field.width, field);
  const [back, far] = between(z, field.column_z, field.depth, field);
  const row = (sampleZ: number) => mix(at(laid, left, sampleZ), at(laid, left + 1, sampleZ), part);
  return mix(row(back), row(back + 1), far);
}

/** The sample before a place along an axis, and the part of the way to the next. */
function between(place: number, first: number, samples: number, { grid, stride }: HeightField): [number, number] {
  const sample = (place / grid.cell_size - first - 0.5) / stride;
  const clamped = Math.min(Math.max(sample, 0), samples - 1);
  return [Math.floor(clamped), clamped % 1];
}

function mix(from: number, to: number, part: number): number {
  return part === 0 ? from : from + (to - from) * part;
}

function at({ field, ground }: Laid, sampleX: number, sampleZ: number): number {
  const [x, z] = [Math.min(sampleX, field.width - 1), Math.min(sampleZ, field.depth - 1)];
  return (field.heights[z * field.width + x] as number) + groundAt(field, ground, x, z);
}

/** The highest elevation of all, a cell at least [m]. */
export function highestOf(laid: Laid): number {
  const { field } = laid;
  let top = field.grid.cell_size;
  for (let z = 0; z < field.depth; z++) {
    for (let x = 0; x < field.width; x++) top = Math.max(top, at(laid, x, z));
  }
  return top;
}

/** Whether a place is in a field's region. */
export function covers({ region, grid }: HeightField, x: number, z: number): boolean {
  const [column, row] = [x / grid.cell_size - region.column_x, z / grid.cell_size - region.column_z];
  return column >= 0 && row >= 0 && column < region.width && row < region.depth;
}
