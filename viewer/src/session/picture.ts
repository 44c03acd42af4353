// What the colours show, and the cells of the fixed grid, fetched while they are looked at.

import type { Cells, ColumnRegion } from "firn-client";
import {
  type CellField,
  type ColumnField,
  cellField,
  columnField,
  type Field,
  fields,
  type Range,
  rangeOf,
} from "../fields.ts";
import { isAlpine } from "../physics.ts";
import type { ColumnValues } from "../scene/tint.ts";
import type { Ground } from "./ground.ts";
import type { Look } from "./look.ts";
import type { Model } from "./model.ts";
import { Value } from "./value.ts";

/** At most so many cells or columns are fetched at once; of larger grids the part around the middle of the picture. */
const MOST_CELLS = 250_000;
/** Between two fetches there is at least this time [ms], and three times as long as a fetch takes. */
const LEAST_PAUSE = 400;
/** The same for quantities of columns, which change with the weather [ms]. */
const COLUMNS_PAUSE = 2000;

/** What colours show, as it is seen from above. */
export interface Shade {
  field: Field;
  range: Range;
  columns: ColumnValues;
  /** Whether it is all of the grid. */
  whole: boolean;
}

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
  /** Null where no cells are needed. */
  readonly picture = new Value<Picture | null>(null);
  /** Null where everything is white. */
  readonly shade = new Value<Shade | null>(null);
  /** What went wrong at the last fetch. */
  readonly problem = new Value<unknown>(null);
  private readonly model: Model;
  private readonly look: Look;
  private fetching: AbortController | null = null;
  private timer = 0;
  private stale = false;
  private tick = 0;
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
    // The weather changes alpine snow also where its heights stay.
    if (isAlpine(model.view.get())) model.view.watch(({ tick }) => this.elapse(tick));
    document.addEventListener("visibilitychange", this.shown);
  }

  /** The column in the middle of the picture. */
  lookAt(column_x: number, column_z: number): void {
    const moved = Math.hypot(column_x - this.middle[0], column_z - this.middle[1]);
    if (moved < 8 || (this.shade.get() ?? this.picture.get())?.whole) return;
    this.middle = [column_x, column_z];
    this.ask();
  }

  close(): void {
    this.fetching?.abort();
    clearTimeout(this.timer);
    this.timer = -1;
    document.removeEventListener("visibilitychange", this.shown);
  }

  private readonly shown = (): void => {
    if (!document.hidden && this.stale) this.ask();
  };

  private elapse(tick: number): void {
    if (tick !== this.tick) this.ask();
    this.tick = tick;
  }

  /** Fetches soon; whatever changes meanwhile is fetched next time. */
  private ask(): void {
    const needed = this.look.shape.get() === "cells" || this.look.colour.get() !== "white";
    const ground = this.model.ground.get();
    this.stale = needed;
    if (!needed) {
      this.picture.set(null);
      this.shade.set(null);
    } else if (columnField(this.look.colour.get()) && document.hidden) return;
    else if (!this.fetching && this.timer === 0 && ground) this.fetch(ground);
  }

  private async fetch(ground: Ground): Promise<void> {
    const begin = performance.now();
    const [colour, shape] = [this.look.colour.get(), this.look.shape.get()];
    const wantsCells = cellField(colour) !== null || shape === "cells";
    const ofCells = cellField(colour) ?? (wantsCells ? (columnField(colour)?.ofCells ?? null) : null);
    const ofColumns = ofCells ? null : columnField(colour);
    const region = this.region(wantsCells ? this.model.grid.height : 1);
    const fetching = new AbortController();
    this.fetching = fetching;
    this.stale = false;
    try {
      const { session } = this.model;
      const query = { ...region, reference: "ground" as const, fields: [...(ofCells?.needs ?? []), "fill"] };
      const [cells, under, columns] = await Promise.all([
        wantsCells ? session.cells(query, fetching.signal) : null,
        wantsCells ? ground.under(region) : null,
        ofColumns ? session.heights({ ...region, quantity: ofColumns.quantity }, fetching.signal) : null,
      ]);
      if (this.fetching !== fetching) return;
      const picture = cells && this.paint(cells, ofCells ?? ofColumns, ground.base, under, columns?.heights ?? null);
      const seen = columns?.heights ?? (picture && topValues(picture));
      this.picture.set(picture);
      this.shade.set(seen && this.shadeOf(ofCells ?? ofColumns, region, seen, picture));
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
      Math.max(ofColumns ? COLUMNS_PAUSE : LEAST_PAUSE, 3 * (performance.now() - begin)),
    );
  }

  /** Cells in colour. Where the colours show a quantity of columns, all cells of a column have its value. */
  private paint(
    cells: Cells,
    field: CellField | ColumnField | null,
    base: number,
    ground: Float32Array | null,
    columns: Float32Array | null,
  ): Picture {
    const { cell_size } = this.model.grid;
    const elevation = (column: number, y: number) => base + (ground?.[column] ?? 0) + (y + 0.5) * cell_size;
    const none = () => new Float32Array(cells.content.length).fill(Number.NaN);
    const values = columns
      ? spread(cells, columns)
      : field && "values" in field
        ? field.values(cells, elevation)
        : none();
    const range = rangeOf(field ?? fields.position, columns ?? values);
    return { cells, ground, field, values, range, whole: this.isWhole(cells) };
  }

  private shadeOf(
    field: Field | null,
    region: ColumnRegion,
    values: Float32Array,
    picture: Picture | null,
  ): Shade | null {
    if (!field) return null;
    const range = picture?.range ?? rangeOf(field, values);
    return { field, range, columns: { ...region, values }, whole: this.isWhole(region) };
  }

  private isWhole({ width, depth }: { width: number; depth: number }): boolean {
    return width === this.model.grid.width && depth === this.model.grid.depth;
  }

  /** What is fetched, at so many cells a column. */
  private region(height: number): ColumnRegion {
    const { width, depth } = this.model.grid;
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

/** The value of its column for each cell of snow. */
function spread({ width, height, content }: Cells, columns: Float32Array): Float32Array {
  return Float32Array.from(content, (what, i) => {
    const column = Math.floor(i / (width * height)) * width + (i % width);
    return what === "snow" ? (columns[column] as number) : Number.NaN;
  });
}

/** The topmost snow's value of each column. */
function topValues({ cells, values }: Picture): Float32Array {
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
