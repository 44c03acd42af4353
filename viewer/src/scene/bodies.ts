// The objects on the snow. One that is held up hovers.

import type { Collider } from "firn-client";
import { DataTexture, Group } from "three";
import type { Plane } from "./cubes.ts";
import { capsOf, type Form, geometryOf, solidsOf } from "./forms.ts";
import { destination, type Point, wayAhead } from "./motion.ts";
import { areaOf, boundsOf, heightOf, type Outline, outlinesOf, toOwn, turnOf } from "./outline.ts";
import { meetBox, type Ray } from "./ray.ts";
import type { Blocker } from "./relief.ts";
import { type Solid, Solids } from "./solids.ts";

/** Time in which a body covers two thirds of the way to where it was last told to be [ms]. */
const EASE = 45;
/** Closer than this [m] it is there, and turned by less than this [°] it is turned. */
const NEAR = 0.001;
const NEARLY_TURNED = 0.05;
/** So far above the snow is drawn what is held up [m]. */
const HOVER = 0.4;
/** Density that snow on an object is drawn with [kg/m³], and how thick it has to be [m]. */
const SNOW_ON_TOP = 100;
const THINNEST = 0.004;

interface Body {
  collider: Collider;
  outlines: Outline[];
  /** Where it is drawn: middle along x and z, and its bottom [m]. */
  at: [number, number, number];
  /** Its heading as it is drawn [°]. */
  heading: number;
  /** Thickness of the snow on it [m]. */
  snow: number;
}

/** All bodies. */
export class Bodies {
  readonly group = new Group();
  private readonly forms = new Map<Form, Solids>();
  private readonly map = new DataTexture(new Uint8Array([178, 102, 68, 255, 236, 168, 66, 255]), 2, 1);
  private bodies = new Map<string, Body>();
  private base = 0;
  private chosen: string | null = null;
  private plane: Plane | null = null;

  constructor() {
    this.map.needsUpdate = true;
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
    this.bodies = new Map();
    for (const collider of colliders) {
      const { at, heading } = before.get(collider.id) ?? { at: this.goal(collider), heading: headingOf(collider) };
      const outlines = outlinesOf({ ...collider, heading });
      this.bodies.set(collider.id, { collider, outlines, at, heading, snow: snowOn(collider, outlines) });
    }
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
      const left = ((((headingOf(body.collider) - body.heading) % 360) + 540) % 360) - 180;
      if (left === 0) continue;
      const far = Math.abs(left) > NEARLY_TURNED;
      moving ||= far;
      body.heading = far ? body.heading + left * part : headingOf(body.collider);
      body.outlines = outlinesOf({ ...body.collider, heading: body.heading });
    }
    if (moving) this.draw();
    return moving;
  }

  /** What they keep the light from. */
  blockers(): Blocker[] {
    return [...this.bodies.values()].flatMap(({ outlines, snow, at: [x, bottom, z] }) =>
      outlines.map((outline) => ({
        x: x + outline.x,
        z: z + outline.z,
        turn: outline.turn,
        shape: outline.shape,
        top: bottom + heightOf(outline.shape) + snow,
      })),
    );
  }

  /** The ways ahead of those that move by themselves. */
  *ways(): Generator<Point[]> {
    for (const { collider } of this.shown()) {
      if (!collider.velocity && !collider.path) continue;
      const { x0, z0, x1, z1 } = boundsOf(collider);
      yield wayAhead(collider, Math.hypot(Math.max(-x0, x1), Math.max(-z0, z1)));
    }
  }

  /** The one that a ray meets first, of those that are shown. What is between its footprints is part of it. */
  meet({ origin, direction }: Ray): { id: string; distance: number } | null {
    let first: { id: string; distance: number } | null = null;
    for (const { collider, outlines, at, heading, snow } of this.shown()) {
      // As seen along its own axes.
      const turn = turnOf(heading);
      const [x, z] = toOwn(turn, origin[0] - at[0], origin[2] - at[2]);
      const [dx, dz] = toOwn(turn, direction[0], direction[2]);
      const { x0, z0, x1, z1 } = boundsOf(collider);
      const top = at[1] + snow + Math.max(...outlines.map(({ shape }) => heightOf(shape)));
      const ray: Ray = { origin: [x, origin[1], z], direction: [dx, direction[1], dz] };
      const distance = meetBox(ray, [x0, at[1], z0], [x1, top, z1]);
      if (distance !== null && distance < (first?.distance ?? Number.POSITIVE_INFINITY)) {
        first = { id: collider.id, distance };
      }
    }
    return first;
  }

  private *shown(): Generator<Body> {
    const { plane } = this;
    for (const body of this.bodies.values()) if (!plane || (body.at[plane.axis] as number) < plane.place) yield body;
  }

  private goal(collider: Collider): [number, number, number] {
    const { bottom, airborne } = collider;
    const { x, z } = destination(collider);
    return [x, bottom - this.base + (airborne ? HOVER : 0), z];
  }

  private draw(): void {
    const drawn = new Map<Form, Solid[]>();
    const add = (all: Iterable<[Form, Solid]>) => {
      for (const [form, solid] of all) {
        const solids = drawn.get(form);
        if (solids) solids.push(solid);
        else drawn.set(form, [solid]);
      }
    };
    for (const { collider, outlines, at, snow } of this.shown()) {
      const value = collider.id === this.chosen ? 1 : 0;
      for (const outline of outlines) {
        add(solidsOf(outline, at, value));
        if (snow > THINNEST) add(capsOf(outline, at, snow));
      }
    }
    for (const [form, solids] of this.forms) {
      if (drawn.has(form)) continue;
      solids.dispose();
      this.forms.delete(form);
    }
    for (const [form, solids] of drawn) (this.forms.get(form) ?? this.begin(form)).show(solids);
  }

  private begin(form: Form): Solids {
    const solids = new Solids(geometryOf(form), false);
    solids.map = this.map;
    this.forms.set(form, solids);
    this.group.add(solids.mesh);
    return solids;
  }
}

/** The heading that it has, or is about to be swept to [°]. */
function headingOf({ heading, turn_to }: Pick<Collider, "heading"> & Partial<Pick<Collider, "turn_to">>): number {
  return turn_to ?? heading;
}

/** How thick the snow on an object is drawn [m]. */
function snowOn({ burden }: Pick<Collider, "burden">, outlines: readonly Outline[]): number {
  const area = outlines.reduce((sum, { shape }) => sum + areaOf(shape), 0);
  return (burden ?? 0) / (SNOW_ON_TOP * area);
}
