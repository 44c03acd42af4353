// How the snow is looked at. Nothing here changes the snow.

import type { Colour } from "../fields.ts";
import type { Point } from "../scene/motion.ts";
import { Value } from "./value.ts";

/** A plane that the snow is cut at; what lies beyond is hidden. */
export interface Cut {
  axis: "x" | "y" | "z";
  /** Where, from 0 to 1 along the axis. */
  at: number;
}

/** What a click on the snow does. */
export type Tool = "profile" | "place" | "path" | "print";

/** A column. */
export interface ColumnPlace {
  column_x: number;
  column_z: number;
}

/** Choices of who looks. */
export class Look {
  /** The surface, or the cells of the fixed grid. */
  readonly shape = new Value<"surface" | "cells">("surface");
  readonly colour = new Value<Colour>("white");
  readonly cut = new Value<Cut | null>(null);
  readonly colliders = new Value(true);
  readonly tool = new Value<Tool>("profile");
  /** Whether objects are lifted to where they are moved, and leave no track. */
  readonly lift = new Value(false);
  /** The path that is being made for the chosen object. */
  readonly draft = new Value<readonly Point[]>([]);
  /** The column whose profile is open. */
  readonly column = new Value<ColumnPlace | null>(null);
  /** The object that is chosen. */
  readonly chosen = new Value<string | null>(null);
}
