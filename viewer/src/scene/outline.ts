// What objects stand on, seen from above. Plain numbers, no graphics.

import type { Collider, Shape } from "firn-client";

/** A heading: forward is (sin, cos) along x and z, to the right is (cos, −sin). */
export interface Turn {
  sin: number;
  cos: number;
}

/** What an object stands on: its one shape, or one of its footprints. */
export interface Outline {
  shape: Shape;
  /** Where its centre is, seen from the object's along x and z [m]. */
  x: number;
  z: number;
  turn: Turn;
}

/** From left to right and from back to front, seen from a centre [m]. */
export interface Rectangle {
  x0: number;
  z0: number;
  x1: number;
  z1: number;
}

/** A compass bearing [°]. */
export function turnOf(degrees: number): Turn {
  const angle = (degrees / 180) * Math.PI;
  return { sin: Math.sin(angle), cos: Math.cos(angle) };
}

/** So far to the right and so far forward, along x and z. */
export function toWorld({ sin, cos }: Turn, right: number, forward: number): [number, number] {
  return [right * cos + forward * sin, forward * cos - right * sin];
}

/** So far along x and z, to the right and forward. */
export function toOwn({ sin, cos }: Turn, x: number, z: number): [number, number] {
  return [x * cos - z * sin, x * sin + z * cos];
}

/** All outlines of an object. */
export function outlinesOf({
  shape,
  footprints,
  heading,
}: Pick<Collider, "shape" | "footprints" | "heading">): Outline[] {
  const turn = turnOf(heading);
  if (shape) return [{ shape, x: 0, z: 0, turn }];
  return (footprints ?? []).map(({ shape, offset, heading: own }) => {
    const [x, z] = toWorld(turn, offset.x, offset.z);
    return { shape, x, z, turn: turnOf(heading + own) };
  });
}

/** How far a shape reaches along its own axes. */
export function extentOf(shape: Shape): Rectangle {
  if (shape.type === "polygon") {
    const [xs, zs] = [shape.corners.map(([x = 0]) => x), shape.corners.map(([, z = 0]) => z)];
    return { x0: Math.min(...xs), z0: Math.min(...zs), x1: Math.max(...xs), z1: Math.max(...zs) };
  }
  const [x, z] = halfSides(shape);
  return { x0: -x, z0: -z, x1: x, z1: z };
}

function halfSides(shape: Exclude<Shape, { type: "polygon" }>): [number, number] {
  switch (shape.type) {
    case "box":
      return [shape.width / 2, shape.depth / 2];
    case "disk":
      return [shape.radius, shape.radius];
    case "capsule":
      return [shape.radius, shape.length / 2];
    case "wheel":
      return [shape.width / 2, shape.radius];
  }
}

/** Whether a place, so far to the right and forward of its centre, is under a shape. */
export function covers(shape: Shape, right: number, forward: number): boolean {
  if (shape.type === "polygon") {
    const sides = shape.corners.map(([x = 0, z = 0], i) => {
      const [nextX = 0, nextZ = 0] = shape.corners[(i + 1) % shape.corners.length] ?? [];
      return (nextX - x) * (forward - z) - (nextZ - z) * (right - x);
    });
    return sides.every((side) => side >= 0) || sides.every((side) => side <= 0);
  }
  const [x, z] = halfSides(shape);
  if (shape.type === "box" || shape.type === "wheel") return Math.abs(right) <= x && Math.abs(forward) <= z;
  // Round at both ends; a disk is nothing but ends.
  return Math.hypot(right, Math.max(0, Math.abs(forward) - (z - x))) <= x;
}

/** Area of a shape [m²]. */
export function areaOf(shape: Shape): number {
  switch (shape.type) {
    case "box":
      return shape.width * shape.depth;
    case "disk":
      return Math.PI * shape.radius ** 2;
    case "capsule":
      return Math.PI * shape.radius ** 2 + 2 * shape.radius * (shape.length - 2 * shape.radius);
    case "wheel":
      return 2 * shape.radius * shape.width;
    case "polygon":
      return Math.abs(signedArea(shape.corners));
  }
}

/** Area within some corners [m²]; negative where x turns to z on the way around. */
export function signedArea(corners: readonly (readonly number[])[]): number {
  return corners.reduce((sum, [x = 0, z = 0], i) => {
    const [nextX = 0, nextZ = 0] = corners[(i + 1) % corners.length] ?? [];
    return sum + (x * nextZ - nextX * z) / 2;
  }, 0);
}

/** How high a shape is drawn [m]. But for wheels they have no height of their own: it is half their width. */
export function heightOf(shape: Shape): number {
  if (shape.type === "wheel") return 2 * shape.radius;
  const { x0, z0, x1, z1 } = extentOf(shape);
  return Math.max(0.15, Math.min(x1 - x0, z1 - z0) / 2);
}

/** The rectangle that holds all outlines of an object, along the object's own axes. */
export function boundsOf(object: Pick<Collider, "shape" | "footprints">): Rectangle {
  const corners = outlinesOf({ ...object, heading: 0 }).flatMap(({ shape, x, z, turn }) => {
    const { x0, z0, x1, z1 } = extentOf(shape);
    const around = [toWorld(turn, x0, z0), toWorld(turn, x1, z0), toWorld(turn, x0, z1), toWorld(turn, x1, z1)];
    return around.map(([cornerX, cornerZ]) => [x + cornerX, z + cornerZ] as const);
  });
  const [xs, zs] = [corners.map(([x]) => x), corners.map(([, z]) => z)];
  return { x0: Math.min(...xs), z0: Math.min(...zs), x1: Math.max(...xs), z1: Math.max(...zs) };
}
