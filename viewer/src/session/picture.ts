// Cells of the fixed grid, fetched while they are looked at.

import type { Cells, ColumnRegion } from "firn-client";
import { type Field, fields, type Range, rangeOf } from "../fields.ts";
import type { Ground } from "./ground.ts";
import type { Look } from "./look.ts";
import type { Model } from "./model.ts";
import { Value } from "./value.ts";

/** At most so many cells are fetched at once; of larger grids the part around the middle of the picture. */
const MOST_CELLS = 250_000;
/** Between two fetches there is at least this time [ms], and three times as long as a fetch takes. */
const LEAST_PAUSE = 400;

/** Cells and what their colours show. */
export interface Picture {
  cells: Cells;
  /** Ground under their columns above the lowest of the session [m], row by row; null where all is level. */
  ground: Float32Array | null;
  /** Null where they are white. */
  field: Field | null;
  /** Values of the field, cell by cell; NaN outside the snow. */
  values: Float32Array;
  range: Range;
  /** Whether it is all of the grid. */
  whole: boolean;
}

/** Keeps the picture up to date. */
export class Pictures {
  readonly picture = new Value<Picture | null>(null);
  /** What went wrong at the last fetch. */
  readonly problem = new Value<unknown>(null);
  private readonly model: Model;
  private readonly look: Look;
  private fetching: AbortController | null = null;
  private timer = 0;
  private stale = false;
  private middle: [number, number];

  constructor(model: Model, look: Look) {
    this.model = model;
    this.look = look;
    this.middle = [model.grid.width / 2, model.grid.depth / 2];
    const again = () => {
      this.fetching?.abort();
      this.fetching = null;
      clearTimeout(this.timer);
      this.timer = 0;
      this.ask();
    };
    look.shape.watch(again);
    look.colour.watch(again);
    model.overview.watch(() => this.ask());
    model.ground.watch(() => this.ask());
  }

  /** The column in the middle of the picture. */
  lookAt(column_x: number, column_z: number): void {
    const moved = Math.hypot(column_x - this.middle[0], column_z - this.middle[1]);
    if (moved < 8 || this.picture.get()?.whole) return;
    this.middle = [column_x, column_z];
    this.ask();
  }

  close(): void {
    this.fetching?.abort();
    clearTimeout(this.timer);
    this.timer = -1;
  }

  /** Fetches soon; whatever changes meanwhile is fetched next time. */
  private ask(): void {
    const needed = this.look.shape.get() === "cells" || this.look.colour.get() !== "white";
    const ground = this.model.ground.get();
    this.stale = needed;
    if (!needed) this.picture.set(null);
    else if (!this.fetching && this.timer === 0 && ground) this.fetch(ground);
  }

  private async fetch(ground: Ground): Promise<void> {
    const begin = performance.now();
    const colour = this.look.colour.get();
    const field: Field | null = colour === "white" ? null : fields[colour];
    const region = this.region();
    const fetching = new AbortController();
    this.fetching = fetching;
    this.stale = false;
    try {
      const query = { ...region, reference: "ground" as const, fields: [...(field?.needs ?? []), "fill"] };
      const asked = this.model.session.cells(query, fetching.signal);
      const [cells, under] = await Promise.all([asked, ground.under(region)]);
      if (this.fetching !== fetching) return;
      this.picture.set(this.paint(cells, field, ground.base, under));
      this.problem.set(null);
    } catch (error) {
      if (fetching.signal.aborted) return;
      this.problem.set(error);
    }
    this.fetching = null;
    this.timer = window.setTimeout(
      () => {
        this.timer = 0;
        if (this.stale) this.ask();
      },
      Math.max(LEAST_PAUSE, 3 * (performance.now() - begin)),
    );
  }

  private paint(cells: Cells, field: Field | null, base: number, ground: Float32Array | null): Picture {
    const { cell_size, width, depth } = this.model.grid;
    const elevation = (column: number, y: number) => base + (ground?.[column] ?? 0) + (y + 0.5) * cell_size;
    const values = field ? field.values(cells, elevation) : new Float32Array(cells.content.length).fill(Number.NaN);
    const whole = cells.width === width && cells.depth === depth;
    return { cells, ground, field, values, range: rangeOf(field ?? fields.position, values), whole };
  }

  private region(): ColumnRegion {
    const { width, depth, height } = this.model.grid;
    const side = Math.floor(Math.sqrt(MOST_CELLS / height));
    const across = Math.min(width, Math.max(side, Math.floor(MOST_CELLS / height / depth)));
    const along = Math.min(depth, Math.floor(MOST_CELLS / height / across));
    const first = (middle: number, count: number, columns: number) =>
      Math.round(Math.max(0, Math.min(middle - count / 2, columns - count)));
    return {
      column_x: first(this.middle[0], across, width),
      column_z: first(this.middle[1], along, depth),
      width: across,
      depth: along,
    };
  }
}
