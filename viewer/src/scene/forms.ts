// The solids that objects are drawn with.

import { Box3, BoxGeometry, BufferGeometry, CylinderGeometry, Float32BufferAttribute } from "three";
import { heightOf, type Outline, signedArea, toWorld } from "./outline.ts";
import { type Solid, WHITE } from "./solids.ts";

/** "box", "disk", "wheel", or the corners of a polygon; the same after "cap ", for snow on it. */
export type Form = string;

/** The top of a cap is so much of its bottom, along x and z. */
const TAPER = 0.9;
/** Snow on a wheel is narrower, so that only what is above the wheel is seen. */
const NARROWER = 0.96;

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

/** The snow that lies on an outline, so thick [m]. */
export function* capsOf(outline: Outline, at: readonly number[], thickness: number): Generator<[Form, Solid]> {
  for (const [form, solid] of solidsOf(outline, at, WHITE)) {
    const [x, y, z] = solid.centre;
    const [width, height, depth] = solid.extent;
    if (form === "wheel") {
      // A crescent is seen.
      yield [form, { ...solid, centre: [x, y + thickness, z], extent: [width * NARROWER, height, depth] }];
      continue;
    }
    // The parts of a capsule meet all the way up.
    const cap = outline.shape.type === "capsule" ? form : `cap ${form}`;
    yield [cap, { ...solid, centre: [x, y + (height + thickness) / 2, z], extent: [width, thickness, depth] }];
  }
}

/** A form of extent 1; a polygon as large as it is, and 1 high. */
export function geometryOf(form: Form): BufferGeometry {
  if (form.startsWith("cap ")) return tapered(geometryOf(form.slice(4)));
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

/** The same with a smaller top. */
function tapered(geometry: BufferGeometry): BufferGeometry {
  geometry.computeBoundingBox();
  const { min, max } = geometry.boundingBox ?? new Box3();
  const positions = geometry.getAttribute("position");
  const inwards = (at: number, low: number, high: number) => (low + high) / 2 + TAPER * (at - (low + high) / 2);
  for (let i = 0; i < positions.count; i++) {
    if (positions.getY(i) < 0) continue;
    positions.setX(i, inwards(positions.getX(i), min.x, max.x));
    positions.setZ(i, inwards(positions.getZ(i), min.z, max.z));
  }
  geometry.computeVertexNormals();
  return geometry;
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
