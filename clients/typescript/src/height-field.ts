// Heights of a region of columns, put together from tiles.

import { GROUND_STEPS_PER_METRE, type GroundTile, type Tile } from "./height-stream.ts";
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
  ground: Float32Array;
  known: Uint8Array;
}

/**
 * Snow depths of a region, and the ground where it is wanted, kept up to date by a subscription. Regions are widened to whole
 * tiles.
 */
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
  /** Elevations of the ground [m], as heights; none where the subscription does not want them. */
  ground = new Float32Array(0);
  private readonly wantsGround: boolean;
  private known = new Uint8Array(0);
  private unknown = 0;

  constructor(grid: Grid, stride: number, region?: ColumnRegion | null, wantsGround = false) {
    this.grid = grid;
    this.stride = stride;
    this.wantsGround = wantsGround;
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
    const { column_x, column_z, width, depth, heights, ground, known, grid, stride } = this;
    const wanted = region ?? { column_x: 0, column_z: 0, width: grid.width, depth: grid.depth };
    const x = span(wanted.column_x, wanted.width, grid.width);
    const z = span(wanted.column_z, wanted.depth, grid.depth);
    this.column_x = x.first;
    this.column_z = z.first;
    this.width = Math.ceil(x.count / stride);
    this.depth = Math.ceil(z.count / stride);
    this.heights = new Float32Array(this.width * this.depth);
    this.ground = new Float32Array(this.wantsGround ? this.heights.length : 0);
    this.forget();
    this.copy({ column_x, column_z, width, depth, heights, ground, known });
  }

  /** Nothing is known any more. */
  forget(): void {
    this.known = new Uint8Array(this.width * this.depth);
    this.unknown = this.known.length;
  }

  /** Takes over a tile's heights. Parts outside the region are left out. */
  put(tile: Tile, quantum: number): void {
    this.each(tile, (index, from) => this.set(index, tile.heights[from] * quantum));
  }

  /** Takes over a tile's ground in the same way. */
  putGround(tile: GroundTile): void {
    if (!this.wantsGround) return;
    this.each(tile, (index, from) => {
      this.ground[index] = tile.heights[from] / GROUND_STEPS_PER_METRE;
    });
  }

  /** All ground is level at 0. */
  putLevelGround(): void {
    this.ground.fill(0);
  }

  private set(index: number, height: number): void {
    this.heights[index] = height;
    this.unknown -= 1 - (this.known[index]);
    this.known[index] = 1;
  }

  private copy(before: Samples): void {
    this.each(before, (index, from) => {
      if (!before.known[from]) return;
      this.set(index, before.heights[from]);
      // A tile's ground is told with its heights.
      if (this.wantsGround) this.ground[index] = before.ground[from];
    });
  }

  /** Calls for each sample of a part that lies in the region, with its index here and there. */
  private each(part: Omit<Samples, "heights" | "ground" | "known">, take: (index: number, from: number) => void): void {
    const x0 = (part.column_x - this.column_x) / this.stride;
    const z0 = (part.column_z - this.column_z) / this.stride;
    const [first, end] = [Math.max(0, -x0), Math.min(part.width, this.width - x0)];
    for (let z = Math.max(0, -z0); z < Math.min(part.depth, this.depth - z0); z++) {
      for (let x = first; x < end; x++) take((z0 + z) * this.width + x0 + x, z * part.width + x);
    }
  }
}

/** Part of an axis, widened to whole tiles and clipped to the grid. */
function span(first: number, count: number, columns: number): { first: number; count: number } {
  const begin = Math.max(0, Math.floor(first / SIDE) * SIDE);
  const end = Math.min(columns, Math.ceil((first + count) / SIDE) * SIDE);
  return { first: begin, count: Math.max(0, end - begin) };
}
