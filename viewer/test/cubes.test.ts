// Which cells are drawn.

import assert from "node:assert/strict";
import { test } from "node:test";
import { Cubes, planeOf } from "../src/scene/cubes.ts";
import type { Picture } from "../src/session/picture.ts";

/** 3 × 3 columns of two full cells of 1 m; the ground of the middle one is raised [m]. */
function picture(raised: number): Picture {
  const cells: Picture["cells"] = {
    tick: 0,
    seq: 0,
    origin: { column_x: 0, column_z: 0, cell_y: 0 },
    width: 3,
    depth: 3,
    height: 2,
    content: Array(18).fill("snow"),
    fields: { fill: Array(18).fill(1) },
  };
  const ground = Float32Array.from({ length: 9 }, (_, i) => (i === 4 ? raised : 0));
  const values = new Float32Array(18).fill(Number.NaN);
  return { cells, ground, field: null, values, range: { low: 0, high: 1, below: false, above: false }, whole: true };
}

test("a neighbour hides a cell up to its own top, and the ground likewise", () => {
  const cubes = new Cubes(1);
  const drawn = (raised: number, cut: "x" | "y" | null = null) => {
    const shown = picture(raised);
    cubes.show(shown, cut && planeOf(shown, { axis: cut, at: 0.5 }, 1));
    return cubes.solids.mesh.geometry.instanceCount;
  };
  // All but the middle column's lower cell and its ground.
  const around = 9 + 8 + 8;
  assert.equal(drawn(0), around);
  assert.equal(drawn(1), around);
  assert.equal(drawn(1.5), around + 1);
  assert.equal(drawn(3), around + 2);
  // Two rows of columns are left, all of them at an edge.
  assert.equal(drawn(0, "x"), 6 * 3);
  // One layer is left, and the middle column's ground is cut at its top.
  assert.equal(drawn(0, "y"), 9 + 8);
  assert.equal(drawn(4, "y"), 8 * 3 + 1);
});
