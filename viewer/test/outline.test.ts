// Where objects stand, seen from above.

import assert from "node:assert/strict";
import { test } from "node:test";
import type { Shape } from "firn-client";
import { geometryOf } from "../src/scene/forms.ts";
import { boundsOf, covers, outlinesOf, toOwn, toWorld, turnOf } from "../src/scene/outline.ts";

function near(found: readonly number[], wanted: readonly number[]): void {
  assert.equal(found.length, wanted.length);
  for (const [i, value] of found.entries()) assert.ok(Math.abs(value - (wanted[i] as number)) < 1e-6, `${found}`);
}

const foot: Shape = { type: "box", width: 0.1, depth: 0.3 };
const walker = {
  footprints: [
    { shape: foot, offset: { x: -0.2, z: 0 }, heading: 0 },
    { shape: foot, offset: { x: 0.2, z: 0.1 }, heading: 90 },
  ],
};

test("a heading is a compass bearing, and footprints turn with their object", () => {
  near(toWorld(turnOf(0), 0, 1), [0, 1]);
  near(toWorld(turnOf(90), 0, 1), [1, 0]);
  near(toWorld(turnOf(90), 1, 0), [0, -1]);
  near(toOwn(turnOf(30), ...toWorld(turnOf(30), 0.7, -2)), [0.7, -2]);
  const [left, right] = outlinesOf({ ...walker, heading: 90 });
  // Heading east, the left foot is to the north.
  near([left?.x ?? 0, left?.z ?? 0], [0, 0.2]);
  near([right?.x ?? 0, right?.z ?? 0], [0.1, -0.2]);
  near(toWorld(right?.turn ?? turnOf(0), 0, 1), [0, -1]);
  const { x0, z0, x1, z1 } = boundsOf(walker);
  near([x0, z0, x1, z1], [-0.25, -0.15, 0.35, 0.15]);
});

test("a shape covers what is under it", () => {
  const inside = (shape: Shape, places: [number, number][]) => places.map(([x, z]) => covers(shape, x, z));
  const capsule: Shape = { type: "capsule", length: 2, radius: 0.5 };
  assert.deepEqual(
    inside(capsule, [
      [0.49, 0.5],
      [0, 0.99],
      [0.4, 0.9],
      [0.51, 0],
    ]),
    [true, true, false, false],
  );
  const disk: Shape = { type: "disk", radius: 1 };
  assert.deepEqual(
    inside(disk, [
      [0.7, 0.7],
      [0.8, 0.8],
    ]),
    [true, false],
  );
  const corners = [
    [0, 1],
    [1, -1],
    [-1, -1],
  ];
  for (const way of [corners, corners.toReversed()]) {
    const polygon: Shape = { type: "polygon", corners: way };
    assert.deepEqual(
      inside(polygon, [
        [0, 0],
        [0.9, 0.9],
        [-0.9, -0.99],
      ]),
      [true, false, true],
    );
  }
});

test("the faces of a polygon are seen from outside, whichever way round its corners are told", () => {
  const corners = [
    [0, 1],
    [1, -1],
    [-1, -1],
  ];
  for (const way of [corners, corners.toReversed()]) {
    const geometry = geometryOf(JSON.stringify(way));
    const [positions, normals] = [geometry.getAttribute("position"), geometry.getAttribute("normal")];
    // Two faces at each end, and two for each side.
    assert.equal(positions.count, 3 * (2 + 6));
    const point = (i: number) => [positions.getX(i), positions.getY(i), positions.getZ(i)] as [number, number, number];
    for (let i = 0; i < positions.count; i += 3) {
      const [a, b, c] = [point(i), point(i + 1), point(i + 2)];
      const [u, v] = [b.map((value, k) => value - (a[k] as number)), c.map((value, k) => value - (a[k] as number))];
      const [ux = 0, uy = 0, uz = 0] = u;
      const [vx = 0, vy = 0, vz = 0] = v;
      const cross = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
      const normal = [normals.getX(i), normals.getY(i), normals.getZ(i)];
      const dot = (p: number[], q: number[]) => p.reduce((sum, value, k) => sum + value * (q[k] as number), 0);
      assert.ok(dot(cross, normal) > 0 && dot(normal, a) > 0);
    }
  }
});
