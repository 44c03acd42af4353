// Heights on a grid of vertices, with what light makes of them. Plain arrays, no graphics.

import type { HeightField, Shape } from "firn-client";
import { toSun } from "./light.ts";
import { covers, extentOf, type Turn, toOwn } from "./outline.ts";

/** Something that throws a shadow: its outline from above around its centre [m], and the elevation of its top [m]. */
export interface Blocker {
  x: number;
  z: number;
  turn: Turn;
  shape: Shape;
  top: number;
}

/** Numbers per vertex: elevation, normal along x and z; then sky seen, sun seen, cover of snow. */
export const SHAPE = 3;
export const LOOK = 3;

/** Less snow than this [m] lets the ground shine through. */
const COVERED = 0.03;
/** Shadows reach so many samples far. */
const REACH = 14;

/**
 * A field's samples with a ring around them, which lies on the region's edge: a vertex for each sample and each point of the
 * ring, (width + 2) · (depth + 2), row by row.
 */
export class Relief {
  readonly columns: number;
  readonly rows: number;
  /** Positions of the columns and rows of vertices [m]. */
  readonly xs: Float32Array;
  readonly zs: Float32Array;
  readonly shape: Float32Array;
  readonly look: Float32Array;
  private readonly elevations: Float32Array;
  private readonly blocked: Float32Array;
  private readonly spacing: number;

  constructor(field: HeightField) {
    const { grid, stride, region } = field;
    const size = grid.cell_size;
    this.columns = field.width + 2;
    this.rows = field.depth + 2;
    this.spacing = stride * size;
    this.xs = places(region.column_x, region.width, field.width, stride, size);
    this.zs = places(region.column_z, region.depth, field.depth, stride, size);
    const count = this.columns * this.rows;
    this.shape = new Float32Array(SHAPE * count);
    this.look = new Float32Array(LOOK * count);
    this.elevations = new Float32Array(count);
    this.blocked = new Float32Array(count);
  }

  /** Takes over the heights of the field that this was made for. */
  update(field: HeightField, ground: Float32Array | null, blockers: Blocker[]): void {
    this.raise(field, ground);
    this.blocked.set(this.elevations);
    for (const blocker of blockers) this.block(blocker);
    const { columns, rows } = this;
    for (let z = 0; z < rows; z++) for (let x = 0; x < columns; x++) this.shade(x, z);
  }

  /** Elevation at a vertex [m]. */
  at(x: number, z: number): number {
    return this.elevations[z * this.columns + x] as number;
  }

  private raise(field: HeightField, ground: Float32Array | null): void {
    const { columns, rows, elevations, look } = this;
    for (let z = 0; z < rows; z++) {
      const sampleZ = Math.min(Math.max(z - 1, 0), field.depth - 1);
      for (let x = 0; x < columns; x++) {
        const sampleX = Math.min(Math.max(x - 1, 0), field.width - 1);
        const height = field.heights[sampleZ * field.width + sampleX] as number;
        const vertex = z * columns + x;
        elevations[vertex] = height + groundAt(field, ground, sampleX, sampleZ);
        look[LOOK * vertex + 2] = Math.min(1, height / COVERED);
      }
    }
  }

  private block({ x: middleX, z: middleZ, turn, shape, top }: Blocker): void {
    const { xs, zs, columns, rows, blocked } = this;
    const { x0, z0, x1, z1 } = extentOf(shape);
    const reach = Math.hypot(Math.max(-x0, x1), Math.max(-z0, z1));
    for (let z = 0; z < rows; z++) {
      const dz = (zs[z] as number) - middleZ;
      if (Math.abs(dz) > reach) continue;
      for (let x = 0; x < columns; x++) {
        const vertex = z * columns + x;
        const dx = (xs[x] as number) - middleX;
        if (Math.abs(dx) > reach || (blocked[vertex] as number) >= top) continue;
        if (covers(shape, ...toOwn(turn, dx, dz))) blocked[vertex] = top;
      }
    }
  }

  private shade(x: number, z: number): void {
    const { columns, rows, elevations, shape, look, xs, zs } = this;
    const vertex = z * columns + x;
    const [left, right] = [Math.max(x - 1, 0), Math.min(x + 1, columns - 1)];
    const [back, front] = [Math.max(z - 1, 0), Math.min(z + 1, rows - 1)];
    const alongX = (xs[right] as number) - (xs[left] as number);
    const alongZ = (zs[front] as number) - (zs[back] as number);
    const slopeX = (this.at(right, z) - this.at(left, z)) / alongX;
    const slopeZ = (this.at(x, front) - this.at(x, back)) / alongZ;
    const length = Math.hypot(slopeX, 1, slopeZ);
    shape[SHAPE * vertex] = elevations[vertex] as number;
    shape[SHAPE * vertex + 1] = -slopeX / length;
    shape[SHAPE * vertex + 2] = -slopeZ / length;
    look[LOOK * vertex] = this.skySeen(x, z);
    look[LOOK * vertex + 1] = this.sunSeen(x, z);
  }

  /** How much of the sky is open: less where the surroundings are higher. */
  private skySeen(x: number, z: number): number {
    const here = this.at(x, z);
    let hidden = 0;
    for (let i = 0; i < AROUND.length; i += 3) {
      const distance = AROUND[i + 2] as number;
      const rise = this.blockedAt(x + (AROUND[i] as number), z + (AROUND[i + 1] as number)) - here;
      if (rise > 0) hidden += rise / (rise + distance * this.spacing);
    }
    return 1 - Math.min(0.75, (3.45 * hidden) / AROUND.length);
  }

  /** How much of the sun is seen, with soft edges: follows the ray to it. */
  private sunSeen(x: number, z: number): number {
    const here = this.at(x, z);
    const flat = Math.hypot(toSun.x, toSun.z);
    const [dx, dz, rise] = [toSun.x / flat, toSun.z / flat, (toSun.y / flat) * this.spacing];
    let hidden = 0;
    for (let step = 1; step <= REACH; step++) {
      const above = this.blockedAt(Math.round(x + dx * step), Math.round(z + dz * step)) - here - rise * step;
      hidden = Math.max(hidden, above / (0.35 * this.spacing * Math.sqrt(step)) + 0.15);
    }
    return 1 - Math.min(1, Math.max(0, hidden - 0.15));
  }

  private blockedAt(x: number, z: number): number {
    const column = Math.min(Math.max(x, 0), this.columns - 1);
    const row = Math.min(Math.max(z, 0), this.rows - 1);
    return this.blocked[row * this.columns + column] as number;
  }
}

/** Samples that may hide the sky: how far along x and z, and their distance. */
const AROUND = [1, 3].flatMap((far) => {
  const near = Math.round(0.7 * far);
  const straight = [far, 0, far, 0, far, far, -far, 0, far, 0, -far, far];
  const across = [near, near, far, -near, near, far, near, -near, far, -near, -near, far];
  return [...straight, ...across];
});

/** Elevation of the ground at a sample of a field [m]. `ground` has one for each sample; null is level ground. */
export function groundAt(field: HeightField, ground: Float32Array | null, sampleX: number, sampleZ: number): number {
  return ground ? (ground[sampleZ * field.width + sampleX] as number) : 0;
}

/** The edge of the region, the middles of the sampled columns, and the other edge. */
function places(first: number, count: number, samples: number, stride: number, size: number): Float32Array {
  const places = new Float32Array(samples + 2);
  places[0] = first * size;
  for (let i = 0; i < samples; i++) places[i + 1] = (first + i * stride + 0.5) * size;
  places[samples + 1] = (first + count) * size;
  return places;
}
