// How objects move, what is drawn of it, and the snow on them, in numbers.

import assert from "node:assert/strict";
import { test } from "node:test";
import type { Shape } from "firn-client";
import { capsOf, geometryOf } from "../src/scene/forms.ts";
import { destination, isSwept, speedOf, wayAhead } from "../src/scene/motion.ts";
import { areaOf, outlinesOf } from "../src/scene/outline.ts";
import { WHITE } from "../src/scene/solids.ts";
import { arrow, lengthOf } from "../src/scene/ways.ts";

const position = { x: 1, z: 2 };

test("an object stays, goes with its velocity, follows a path, or is swept", () => {
  assert.deepEqual([speedOf({ position }), wayAhead({ position }, 1)], [0, []]);
  const going = { position, velocity: { x: 3, z: -4 } };
  assert.equal(speedOf(going), 5);
  const [begin, end] = wayAhead(going, 1);
  assert.ok(begin && end);
  // It begins at its outline, and is a second long.
  assert.ok(Math.hypot(begin[0] - 1.6, begin[1] - 1.2) < 1e-9);
  assert.ok(Math.abs(lengthOf([begin, end]) - 5) < 1e-9);

  const path = [
    [2, 2],
    [2, 3],
  ];
  const following = { ...going, path, speed: 0.5 };
  assert.deepEqual([speedOf(following), isSwept(following), destination(following)], [0.5, false, position]);
  assert.deepEqual(wayAhead(following, 1), [[1, 2], ...path]);
  const swept = { position, path };
  assert.deepEqual([speedOf(swept), isSwept(swept), destination(swept)], [0, true, { x: 2, z: 3 }]);
});

test("a way is an arrow: a line that ends where its head begins", () => {
  assert.deepEqual([...arrow([], 1)], []);
  assert.deepEqual([...arrow([[1, 1]], 1)], []);
  // Twice the same point is no way, also at its end.
  const way = [
    [0, 0],
    [2, 0],
    [2, 0],
  ] as const;
  const corners = [...arrow(way, 1)];
  assert.equal(corners.length, 2 * 6 + 3);
  const [tip, ...base] = corners.slice(-3);
  assert.deepEqual([tip?.x, tip?.z, Math.hypot(...(tip?.aside ?? []))], [2, 0, 0]);
  assert.ok(base.every(({ x, aside }) => x === 2 && aside[0] < 0));
  const line = corners.slice(0, -3).filter(({ x }) => x === 2);
  assert.ok(line.length > 0 && line.every(({ aside }) => aside[0] === base[0]?.aside[0]));
});

test("areas are those of the outlines", () => {
  const triangle = [
    [0, 1],
    [1, -1],
    [-1, -1],
  ];
  const areas: [Shape, number][] = [
    [{ type: "box", width: 2, depth: 3 }, 6],
    [{ type: "disk", radius: 1 }, Math.PI],
    [{ type: "capsule", length: 3, radius: 1 }, Math.PI + 2],
    [{ type: "wheel", width: 0.2, radius: 0.5 }, 0.2],
    [{ type: "polygon", corners: triangle }, 2],
    [{ type: "polygon", corners: triangle.toReversed() }, 2],
  ];
  for (const [shape, area] of areas) assert.ok(Math.abs(areaOf(shape) - area) < 1e-9, shape.type);
});

test("a cap of snow lies on top, is white and as thick as told", () => {
  const top = (shape: Shape, thickness: number) => {
    const [outline] = outlinesOf({ shape, heading: 30 });
    assert.ok(outline);
    return [...capsOf(outline, [1, 2, 3], thickness)].map(([form, { centre, extent, value }]) => {
      assert.equal(value, WHITE);
      assert.ok(geometryOf(form).getAttribute("normal").count > 0);
      return centre[1] + extent[1] / 2;
    });
  };
  const near = (found: number[], wanted: number[]) => {
    assert.equal(found.length, wanted.length);
    for (const [i, value] of found.entries()) assert.ok(Math.abs(value - (wanted[i] as number)) < 1e-9, `${found}`);
  };
  // Boxes are drawn half as high as they are wide.
  near(top({ type: "box", width: 2, depth: 3 }, 0.3), [3.3]);
  near(top({ type: "wheel", width: 0.2, radius: 0.5 }, 0.1), [3.1]);
  near(top({ type: "capsule", length: 3, radius: 1 }, 0.2), [3.2, 3.2, 3.2]);
  const cap = geometryOf("cap box").getAttribute("position");
  const widest = (upper: boolean) => {
    const of = Array.from({ length: cap.count }, (_, i) => i).filter((i) => cap.getY(i) > 0 === upper);
    return Math.max(...of.map((i) => cap.getX(i)));
  };
  assert.ok(widest(true) < widest(false));
});
