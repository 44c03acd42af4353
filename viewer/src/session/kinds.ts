// Kinds of objects: what the panel offers, and what the list calls what is there.

import type { Collider, ColliderSpec, FootprintSpec, Shape } from "firn-client";

/** Sizes that a kind asks for [m]. */
export type Size = "width" | "depth" | "length" | "radius";

/** What an object stands on. */
type Standing = Pick<ColliderSpec, "shape" | "footprints">;

interface KindOfObject {
  name: string;
  sizes: readonly Size[];
  /** Its usual mass [kg]. */
  mass: number;
  make: (size: Record<Size, number>) => Standing;
}

/** A foot in a boot. */
export const foot: Shape = { type: "capsule", length: 0.3, radius: 0.06 };
const tyre: Shape = { type: "wheel", width: 0.2, radius: 0.32 };

/** Everything that the panel offers. */
export const kinds = {
  box: {
    name: "Box",
    sizes: ["width", "depth"],
    mass: 100,
    make: ({ width, depth }) => ({ shape: { type: "box", width, depth } }),
  },
  disk: { name: "Disk", sizes: ["radius"], mass: 100, make: ({ radius }) => ({ shape: { type: "disk", radius } }) },
  capsule: {
    name: "Capsule",
    sizes: ["length", "radius"],
    mass: 100,
    make: ({ length, radius }) => ({ shape: { type: "capsule", length, radius } }),
  },
  wheel: {
    name: "Wheel",
    sizes: ["width", "radius"],
    mass: 100,
    make: ({ width, radius }) => ({ shape: { type: "wheel", width, radius } }),
  },
  walker: {
    name: "Walker",
    sizes: [],
    mass: 80,
    make: () => ({ footprints: [at(foot, -0.12, 0), at(foot, 0.12, 0)] }),
  },
  car: {
    name: "Car",
    sizes: [],
    mass: 1500,
    make: () => ({
      footprints: [at(tyre, -0.75, 1.3), at(tyre, 0.75, 1.3), at(tyre, -0.75, -1.3), at(tyre, 0.75, -1.3)],
    }),
  },
} satisfies Record<string, KindOfObject>;

/** Name of a kind. */
export type Kind = keyof typeof kinds;

function at(shape: Shape, x: number, z: number): FootprintSpec {
  return { shape, offset: { x, z } };
}

/** The first name of a kind, such as box-1, that is not taken. */
export function freeName(kind: string, taken: ReadonlySet<string>): string {
  let number = 1;
  while (taken.has(`${kind}-${number}`)) number++;
  return `${kind}-${number}`;
}

/** What an object is, in words. */
export function describe({ shape, footprints = [] }: Pick<Collider, "shape" | "footprints">): string {
  if (shape) return describeShape(shape);
  const shapes = [...new Set(footprints.map(({ shape }) => describeShape(shape)))];
  return `${footprints.length} × ${shapes.length === 1 ? shapes[0] : "footprint"}`;
}

function describeShape(shape: Shape): string {
  const metres = (value: number) => String(Number(value.toFixed(2)));
  switch (shape.type) {
    case "box":
      return `box ${metres(shape.width)} × ${metres(shape.depth)} m`;
    case "disk":
      return `disk ⌀ ${metres(2 * shape.radius)} m`;
    case "capsule":
      return `capsule ${metres(2 * shape.radius)} × ${metres(shape.length)} m`;
    case "wheel":
      return `wheel ⌀ ${metres(2 * shape.radius)} m`;
    case "polygon":
      return `polygon with ${shape.corners.length} corners`;
  }
}
