// How objects move by themselves. Plain numbers, no graphics.

import type { Collider, Position } from "firn-client";

/** A place along x and z [m]. */
export type Point = readonly [number, number];

/** How an object moves. An absent velocity is 0; an absent path means that it follows none. */
type Moving = Pick<Collider, "position"> & Partial<Pick<Collider, "velocity" | "path" | "speed">>;

/** An arrow is as long as the way of so many seconds, within these limits [m]. */
const SECONDS = 1;
const [SHORTEST, LONGEST] = [0.3, 12];

/** Whether it is about to be swept to where somebody moved it. */
export function isSwept({ path, speed }: Moving): boolean {
  return path !== undefined && path.length > 0 && typeof speed !== "number";
}

/** Where it is, or will be once it was swept there. */
export function destination(object: Moving): Position {
  const [x, z] = (isSwept(object) && object.path?.at(-1)) || [];
  return x === undefined || z === undefined ? object.position : { x, z };
}

/** How fast it goes by itself [m/s]. */
export function speedOf(object: Moving): number {
  if (isSwept(object)) return 0;
  const { x, z } = object.velocity ?? { x: 0, z: 0 };
  return object.path?.length ? (object.speed ?? 0) : Math.hypot(x, z);
}

/** The way ahead of it: what is left of its path, or an arrow that begins at a distance from its centre [m]. */
export function wayAhead(object: Moving, distance: number): Point[] {
  const { x, z } = object.position;
  if (object.path?.length) return [[x, z], ...object.path.map(([x = 0, z = 0]) => [x, z] as const)];
  const speed = speedOf(object);
  if (speed === 0) return [];
  const [dx, dz] = [(object.velocity?.x ?? 0) / speed, (object.velocity?.z ?? 0) / speed];
  const end = distance + Math.min(Math.max(speed * SECONDS, SHORTEST), LONGEST);
  return [distance, end].map((at) => [x + dx * at, z + dz * at] as const);
}
