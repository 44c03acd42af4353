// The objects on the snow. They have no height of their own: they are drawn half as high as they are wide.

import type { Collider } from "firn-client";
import { BoxGeometry, CylinderGeometry, DataTexture, Group } from "three";
import type { Plane } from "./cubes.ts";
import type { Blocker } from "./relief.ts";
import { type Solid, Solids } from "./solids.ts";

/** Time in which a body covers two thirds of the way to where it was last told to be [ms]. */
const EASE = 45;
/** Closer than this [m] it is there. */
const NEAR = 0.001;

/** Extent of a body along x, y and z [m]. */
export function extentOf({ shape }: Pick<Collider, "shape">): [number, number, number] {
  const [width, depth] = shape.type === "box" ? [shape.width, shape.depth] : [2 * shape.radius, 2 * shape.radius];
  return [width, Math.max(0.15, Math.min(width, depth) / 2), depth];
}

interface Body {
  collider: Collider;
  /** Where it is drawn: middle along x and z, and its bottom [m]. */
  at: [number, number, number];
}

/** All bodies. */
export class Bodies {
  readonly group = new Group();
  private readonly boxes = new Solids(new BoxGeometry(1, 1, 1), false);
  private readonly disks = new Solids(new CylinderGeometry(0.5, 0.5, 1, 40), false);
  private bodies = new Map<string, Body>();
  private base = 0;
  private chosen: string | null = null;
  private plane: Plane | null = null;

  constructor() {
    const map = new DataTexture(new Uint8Array([178, 102, 68, 255, 236, 168, 66, 255]), 2, 1);
    map.needsUpdate = true;
    this.boxes.map = map;
    this.disks.map = map;
    this.group.add(this.boxes.mesh, this.disks.mesh);
  }

  /** Has an elevation [m] drawn at 0. */
  drawFrom(base: number): void {
    for (const { at } of this.bodies.values()) at[1] += this.base - base;
    this.base = base;
    this.draw();
  }

  /** Takes over the objects as they are now. */
  update(colliders: readonly Collider[]): void {
    const before = this.bodies;
    this.bodies = new Map(
      colliders.map((collider) => [collider.id, { collider, at: before.get(collider.id)?.at ?? this.goal(collider) }]),
    );
    this.draw();
  }

  /** Marks one of them. */
  choose(id: string | null): void {
    this.chosen = id;
    this.draw();
  }

  /** Hides those whose middle lies beyond a plane. */
  cut(plane: Plane | null): void {
    this.plane = plane;
    this.draw();
  }

  /** Moves bodies to where they are by now; true while they are on their way. */
  advance(milliseconds: number): boolean {
    const part = 1 - Math.exp(-milliseconds / EASE);
    let moving = false;
    for (const body of this.bodies.values()) {
      const goal = this.goal(body.collider);
      for (const axis of [0, 1, 2] as const) {
        const way = goal[axis] - body.at[axis];
        const far = Math.abs(way) > NEAR;
        moving ||= far;
        body.at[axis] = far ? body.at[axis] + way * part : goal[axis];
      }
    }
    if (moving) this.draw();
    return moving;
  }

  /** What they keep the light from. */
  blockers(): Blocker[] {
    return [...this.bodies.values()].map(({ collider, at: [x, bottom, z] }) => {
      const [width, height, depth] = extentOf(collider);
      return { x0: x - width / 2, x1: x + width / 2, z0: z - depth / 2, z1: z + depth / 2, top: bottom + height };
    });
  }

  /** Those that are shown, as they are drawn: the lowest and the highest corner of each. */
  *boxesAround(): Generator<{ collider: Collider; low: number[]; high: number[] }> {
    for (const { collider, at } of this.shown()) {
      const [width, height, depth] = extentOf(collider);
      const [x, y, z] = at;
      yield {
        collider,
        low: [x - width / 2, y, z - depth / 2],
        high: [x + width / 2, y + height, z + depth / 2],
      };
    }
  }

  private *shown(): Generator<Body> {
    const { plane } = this;
    for (const body of this.bodies.values()) if (!plane || (body.at[plane.axis] as number) < plane.place) yield body;
  }

  private goal({ position, bottom }: Collider): [number, number, number] {
    return [position.x, bottom - this.base, position.z];
  }

  private draw(): void {
    const [boxes, disks]: [Solid[], Solid[]] = [[], []];
    for (const { collider, at } of this.shown()) {
      const extent = extentOf(collider);
      const centre = [at[0], at[1] + extent[1] / 2, at[2]] as const;
      const solids = collider.shape.type === "box" ? boxes : disks;
      solids.push({ centre, extent, value: collider.id === this.chosen ? 1 : 0 });
    }
    this.boxes.show(boxes);
    this.disks.show(disks);
  }
}
