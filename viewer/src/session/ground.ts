// The ground that the snow lies on.

import type { ColumnRegion, Session } from "firn-client";
import { extremes } from "../extremes.ts";

/** The ground of a session as it was when it was asked for. Other ground is another object. */
export class Ground {
  /** Elevation of the lowest ground [m]. Pictures begin there. */
  readonly base: number;
  /** How far the highest is above it [m]. */
  readonly relief: number;
  /** Ground under each sample of the overview, above the lowest [m]; null where all is level. */
  readonly overview: Float32Array | null;
  private readonly session: Session;
  private last: { region: ColumnRegion; heights: Float32Array } | null = null;

  constructor(session: Session, elevations: Float32Array | null) {
    const [lowest, highest] = extremes(elevations);
    this.session = session;
    this.base = lowest;
    this.relief = highest - lowest;
    this.overview = elevations && this.above(elevations);
  }

  /** Ground under each column of a region, above the lowest [m]; null where all is level. */
  async under(region: ColumnRegion): Promise<Float32Array | null> {
    if (!this.overview) return null;
    if (this.last && isSame(this.last.region, region)) return this.last.heights;
    const heights = this.above((await this.session.terrain(region)).heights);
    this.last = { region, heights };
    return heights;
  }

  private above(elevations: Float32Array): Float32Array {
    return elevations.map((elevation) => elevation - this.base);
  }
}

/** Whether two regions are the same columns. */
export function isSame(one: ColumnRegion, other: ColumnRegion): boolean {
  const { column_x, column_z, width, depth } = other;
  return one.column_x === column_x && one.column_z === column_z && one.width === width && one.depth === depth;
}
