// Heights of a region of columns, put together from tiles.

import type { Tile } from "./height-stream.ts";
import type { ColumnRegion, Grid } from "./types.ts";

/** Columns along one side of a tile. */
const SIDE = 8;

/** Samples of a region, and which of them are known. */
interface Samples {
  column_x: number;
  column_z: number;
  width: number;
  depth: number;
  heights: Float32Array;
  known: Uint8Array;
}

/** Snow depths of a region, kept up to date by a subscription. Regions are widened to whole tiles. */
export class HeightField {
  readonly grid: Grid;
  /** Columns from one sample to the next. */
  readonly stride: number;
  /** First column along x, and along z. */
  column_x = 0;
  column_z = 0;
  /** Samples along x, and along z. */
  width = 0;
  depth = 0;
  /** Snow depths [m], row by row: index = z · width + x. 0 where nothing is known yet. */
  heights = new Float32Array(0);
  private known = new Uint8Array(0);
  private unknown = 0;

  constructor(grid: Grid, stride: number, region?: ColumnRegion | null) {
    this.grid = grid;
    this.stride = stride;
    this.moveTo(region);
  }

  /** Whether the height of every sample is known. */
  get complete(): boolean {
    return this.unknown === 0;
  }

  /** The region, in columns. */
  get region(): ColumnRegion {
    const { column_x, column_z, grid, stride } = this;
    const width = Math.min(this.width * stride, grid.width - column_x);
    const depth = Math.min(this.depth * stride, grid.depth - column_z);
    return { column_x, column_z, width, depth };
  }

  /** Looks at another region; what is known of it stays known. */
  moveTo(region?: ColumnRegion | null): void {
    const { column_x, column_z, width, depth, heights, known, grid, stride } = this;
    const wanted = region ?? { column_x: 0, column_z: 0, width: grid.width, depth: grid.depth };
    const x = span(wanted.column_x, wanted.width, grid.width);
    const z = span(wanted.column_z, wanted.depth, grid.depth);
    this.column_x = x.first;
    this.column_z = z.first;
    this.width = Math.ceil(x.count / stride);
    this.depth = Math.ceil(z.count / stride);
    this.heights = new Float32Array(this.width * this.depth);
    this.forget();
    this.copy({ column_x, column_z, width, depth, heights, known });
  }

  /** Nothing is known any more. */
  forget(): void {
    this.known = new Uint8Array(this.width * this.depth);
    this.unknown = this.known.length;
  }

  /** Takes over a tile's heights. Parts outside the region are left out. */
  put(tile: Tile, quantum: number): void {
    const x0 = (tile.column_x - this.column_x) / this.stride;
    const z0 = (tile.column_z - this.column_z) / this.stride;
    for (let z = 0; z < tile.depth; z++) {
      for (let x = 0; x < tile.width; x++) {
        this.set(x0 + x, z0 + z, (tile.heights[z * tile.width + x]) * quantum);
      }
    }
  }

  private set(x: number, z: number, height: number): void {
    if (x < 0 || z < 0 || x >= this.width || z >= this.depth) return;
    const index = z * this.width + x;
    this.heights[index] = height;
    this.unknown -= 1 - (this.known[index]);
    this.known[index] = 1;
  }

  private copy(before: Samples): void {
    const dx = (before.column_x - this.column_x) / this.stride;
    const dz = (before.column_z - this.column_z) / this.stride;
    for (let z = 0; z < before.depth; z++) {
      for (let x = 0; x < before.width; x++) {
        const index = z * before.width + x;
        if (before.known[index]) this.set(x + dx, z + dz, before.heights[index]);
      }
    }
  }
}

/** Part of an axis, widened to whole tiles and clipped to the grid. */
function span(first: number, count: number, columns: number): { first: number; count: number } {
  const begin = Math.max(0, Math.floor(first / SIDE) * SIDE);
  const end = Math.min(columns, Math.ceil((first + count) / SIDE) * SIDE);
  return { first: begin, count: Math.max(0, end - begin) };
}
