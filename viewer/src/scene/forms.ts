// The solids that objects are drawn with.

import { BoxGeometry, BufferGeometry, CylinderGeometry, Float32BufferAttribute } from "three";
import { heightOf, type Outline, toWorld } from "./outline.ts";
import type { Solid } from "./solids.ts";

/** "box", "disk", "wheel", or the corners of a polygon. */
export type Form = string;

/** What an outline is drawn with, its object's bottom centre being `at` [m]. */
export function* solidsOf(outline: Outline, at: readonly number[], value: number): Generator<[Form, Solid]> {
  const { shape, turn } = outline;
  const height = heightOf(shape);
  const solid = (width: number, depth: number, forward = 0): Solid => {
    const [x, z] = toWorld(turn, 0, forward);
    const [ox, oy, oz] = at as [number, number, number];
    const centre = [ox + outline.x + x, oy + height / 2, oz + outline.z + z] as const;
    return { centre, extent: [width, height, depth], turn, value };
  };
  switch (shape.type) {
    case "box":
      return yield ["box", solid(shape.width, shape.depth)];
    case "disk":
      return yield ["disk", solid(2 * shape.radius, 2 * shape.radius)];
    case "wheel":
      return yield ["wheel", solid(shape.width, 2 * shape.radius)];
    case "capsule": {
      const [width, straight] = [2 * shape.radius, shape.length - 2 * shape.radius];
      yield ["disk", solid(width, width, -straight / 2)];
      if (straight > 0) yield ["box", solid(width, straight)];
      return yield ["disk", solid(width, width, straight / 2)];
    }
    case "polygon":
      return yield [JSON.stringify(shape.corners), solid(1, 1)];
  }
}

/** A form of extent 1; a polygon as large as it is, and 1 high. */
export function geometryOf(form: Form): BufferGeometry {
  switch (form) {
    case "box":
      return new BoxGeometry(1, 1, 1);
    case "disk":
      return new CylinderGeometry(0.5, 0.5, 1, 40);
    case "wheel":
      return new CylinderGeometry(0.5, 0.5, 1, 40).rotateZ(Math.PI / 2);
    default:
      return prism(JSON.parse(form));
  }
}

type Corner = readonly [number, number];

function prism(corners: Corner[]): BufferGeometry {
  // The faces are seen from outside if the corners go round this way.
  const ring = signedArea(corners) < 0 ? corners : corners.toReversed();
  const [positions, normals]: [number[], number[]] = [[], []];
  const face = (normal: readonly number[], ...points: (readonly number[])[]) => {
    for (const point of points) {
      positions.push(...point);
      normals.push(...normal);
    }
  };
  const [first, ...others] = ring as [Corner, ...Corner[]];
  const place = ([x, z]: Corner, y: number) => [x, y, z];
  for (const [i, corner] of others.slice(1).entries()) {
    const before = others[i] as Corner;
    face([0, 1, 0], place(first, 0.5), place(before, 0.5), place(corner, 0.5));
    face([0, -1, 0], place(first, -0.5), place(corner, -0.5), place(before, -0.5));
  }
  for (const [i, from] of ring.entries()) {
    const to = ring[(i + 1) % ring.length] as Corner;
    const [dx, dz] = [to[0] - from[0], to[1] - from[1]];
    const length = Math.hypot(dx, dz) || 1;
    const out = [-dz / length, 0, dx / length];
    face(out, place(from, -0.5), place(to, -0.5), place(to, 0.5));
    face(out, place(from, -0.5), place(to, 0.5), place(from, 0.5));
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(positions, 3));
  geometry.setAttribute("normal", new Float32BufferAttribute(normals, 3));
  return geometry;
}

function signedArea(corners: Corner[]): number {
  return corners.reduce((sum, [x, z], i) => {
    const [nextX, nextZ] = corners[(i + 1) % corners.length] as Corner;
    return sum + x * nextZ - nextX * z;
  }, 0);
}
