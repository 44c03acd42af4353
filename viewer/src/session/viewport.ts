// The 3D picture of a session: what the model knows, shown as the look says.

import type { HeightField } from "firn-client";
import { BoxGeometry, Mesh, MeshBasicMaterial, Vector3 } from "three";
import { Bodies } from "../scene/bodies.ts";
import { Cubes, PLINTH, planeOf } from "../scene/cubes.ts";
import { destination } from "../scene/motion.ts";
import { meetSurface, type Ray } from "../scene/ray.ts";
import { Stage } from "../scene/scene.ts";
import { Surface } from "../scene/surface.ts";
import { mapTexture, Tint } from "../scene/tint.ts";
import { Ways } from "../scene/ways.ts";
import { type Ground, isSame } from "./ground.ts";
import { covers, elevationIn, highestOf, type Laid } from "./laid.ts";
import type { Look } from "./look.ts";
import type { Model } from "./model.ts";
import type { Pictures, Shade } from "./picture.ts";

/** Width of the drawer with the profile, as in session.css [px]. */
const PROFILE_WIDTH = 416;

/** What a ray meets first. */
export interface Hit {
  /** An object; null where it is the snow. */
  body: string | null;
  /** Where [m]. */
  x: number;
  y: number;
  z: number;
}

/** The picture. */
export class Viewport {
  readonly stage: Stage;
  private readonly model: Model;
  private readonly look: Look;
  private readonly pictures: Pictures;
  private readonly bodies: Bodies;
  private readonly tint: Tint;
  private readonly surface: Surface;
  private readonly nearby: Surface;
  private readonly cubes: Cubes;
  private readonly marker: Mesh;
  /** The ways of objects that move by themselves, and the path that is being made. */
  private readonly ways: Ways;
  private readonly draft: Ways;
  /** What has to be brought up to date before the next frame. */
  private readonly stale = { surface: false, nearby: false, cubes: false, ways: false };
  private framed = false;
  private relief = 0;
  /** Whether cells were asked for and the camera may still be too far away to see any. */
  private afar = false;

  constructor(canvas: HTMLCanvasElement, model: Model, look: Look, pictures: Pictures) {
    this.model = model;
    this.look = look;
    this.pictures = pictures;
    const { width, depth, cell_size: size } = model.grid;
    const plinth = PLINTH * Math.max(width, depth) * size;
    this.tint = new Tint(size);
    this.surface = new Surface(this.tint, plinth);
    this.nearby = new Surface(this.tint, plinth);
    this.cubes = new Cubes(size);
    this.bodies = new Bodies();
    this.ways = new Ways(size, 0xb26644);
    this.bodies.group.add(this.ways.mesh);
    this.draft = new Ways(size, 0x22577f);
    const marker = new MeshBasicMaterial({ color: 0xd9822b, transparent: true, opacity: 0.75 });
    this.marker = new Mesh(new BoxGeometry(1, 1, 1), marker);
    this.marker.visible = false;
    this.stage = new Stage(canvas, {
      advance: (milliseconds) => this.advance(milliseconds),
      refine: (fine) => {
        this.surface.refine(fine);
        this.nearby.refine(fine);
      },
    });
    const { solids } = this.cubes;
    this.stage.scene.add(this.surface.group, this.nearby.group, solids.mesh, this.bodies.group);
    this.stage.scene.add(this.draft.mesh, this.marker);
    this.stage.controls.addEventListener("change", () => this.lookedAt());
    this.watch();
  }

  /** What lies under a point of the window; `bodies` says whether bodies count. */
  pick(clientX: number, clientY: number, bodies = true): Hit | null {
    const ray = this.stage.rayAt(clientX, clientY);
    const distance = this.meetSnow(ray) ?? Number.POSITIVE_INFINITY;
    const body = bodies && this.look.colliders.get() ? this.bodies.meet(ray) : null;
    const hit =
      body && body.distance < distance ? { distance: body.distance, body: body.id } : { distance, body: null };
    if (!Number.isFinite(hit.distance)) return null;
    const [x, y, z] = [0, 1, 2].map((axis) => {
      return (ray.origin[axis] as number) + hit.distance * (ray.direction[axis] as number);
    }) as [number, number, number];
    return { body: hit.body, x, y, z };
  }

  /** Where a ray through a point of the window meets the level y [m]. */
  pickLevel(clientX: number, clientY: number, y: number): { x: number; z: number } | null {
    const { origin, direction } = this.stage.rayAt(clientX, clientY);
    const distance = (y - origin[1]) / direction[1];
    if (!(distance > 0) || distance > 1e4) return null;
    return { x: origin[0] + distance * direction[0], z: origin[2] + distance * direction[2] };
  }

  /** The place in the middle of the picture [m]. */
  middle(): { x: number; z: number } {
    const { x, z } = this.stage.controls.target;
    const { width, depth, cell_size } = this.model.grid;
    return { x: Math.min(Math.max(x, 0), width * cell_size), z: Math.min(Math.max(z, 0), depth * cell_size) };
  }

  close(): void {
    this.stage.close();
  }

  private watch(): void {
    const { model, look, pictures } = this;
    model.ground.watch((ground) => this.stand(ground));
    model.overview.watch(() => this.mark("surface"));
    model.detail.watch(() => this.mark("nearby"));
    model.near.watch(() => this.mark("nearby"));
    model.colliders.watch((colliders) => {
      this.bodies.update(colliders);
      this.mark("ways");
    });
    look.colliders.watch((visible) => {
      this.bodies.group.visible = visible;
      this.mark("surface");
      this.mark("nearby");
    });
    look.chosen.watch((id) => {
      this.bodies.choose(id);
      this.mark("ways");
    });
    look.draft.watch(() => this.mark("ways"));
    look.cut.watch(() => this.mark("cubes"));
    look.shape.watch((shape) => {
      this.afar = shape === "cells";
      this.mark("cubes");
    });
    look.column.watch((column) => {
      this.stage.keepLeftFree(column ? PROFILE_WIDTH : 0);
      this.mark("surface");
    });
    pictures.shade.watch((shade) => {
      this.recolour(shade);
      this.stage.redraw();
    });
    pictures.picture.watch(() => this.mark("cubes"));
  }

  private mark(part: keyof Viewport["stale"]): void {
    this.stale[part] = true;
    this.stage.redraw();
  }

  private advance(milliseconds: number): boolean {
    const moving = this.bodies.advance(milliseconds);
    const { stale } = this;
    const blockers = this.look.colliders.get() ? this.bodies.blockers() : [];
    const [whole, near] = [stale.surface ? this.whole() : null, stale.nearby ? this.near() : null];
    if (whole) {
      this.surface.update(whole.field, whole.ground, blockers);
      if (!this.framed) this.frame(whole);
      this.placeMarker(whole);
      stale.surface = false;
    }
    if (near) {
      this.nearby.update(near.field, near.ground, blockers);
      this.cutHole(near.field);
      stale.nearby = false;
    }
    if (stale.cubes) this.showCubes();
    if (whole || near || stale.ways) this.showWays();
    return moving;
  }

  private showWays(): void {
    const whole = this.whole();
    if (!whole) return;
    this.stale.ways = false;
    const elevationAt = this.elevations(whole);
    this.ways.show(this.bodies.ways(), elevationAt);
    const points = this.look.draft.get();
    const chosen = this.model.colliders.get().find(({ id }) => id === this.look.chosen.get());
    const { x, z } = chosen ? destination(chosen) : { x: 0, z: 0 };
    this.draft.show(points.length > 0 ? [chosen ? [[x, z], ...points] : points] : [], elevationAt);
  }

  /** How high the snow is at a place [m], as closely as it is known. */
  private elevations(whole: Laid): (x: number, z: number) => number {
    const near = this.near();
    return (x, z) => elevationIn(near && covers(near.field, x, z) ? near : whole, x, z);
  }

  /** All of the snow on its ground; null until both are known. */
  private whole(): Laid | null {
    const [field, ground] = [this.model.overview.get()?.field, this.model.ground.get()];
    return field?.complete && ground ? { field, ground: ground.overview } : null;
  }

  /** What is watched closely. */
  private near(): Laid | null {
    const [field, near] = [this.model.detail.get()?.field, this.model.near.get()];
    return field?.complete && near && isSame(field.region, near.region) ? { field, ground: near.heights } : null;
  }

  private stand(ground: Ground | null): void {
    if (!ground) return;
    this.bodies.drawFrom(ground.base);
    this.framed &&= this.relief === ground.relief;
    this.relief = ground.relief;
    this.mark("surface");
  }

  private showCubes(): void {
    this.stale.cubes = false;
    const picture = this.pictures.picture.get();
    const asCubes = this.look.shape.get() === "cells" && picture !== null;
    const cut = asCubes ? this.look.cut.get() : null;
    const plane = cut && picture ? planeOf(picture, cut, this.model.grid.cell_size) : null;
    if (asCubes) this.cubes.show(picture, plane);
    if (asCubes && this.afar) {
      const { width, depth } = picture.cells;
      if (!picture.whole) this.stage.approach(2.5 * Math.max(width, depth) * this.model.grid.cell_size);
      this.afar = false;
    }
    this.bodies.cut(plane);
    this.cubes.solids.mesh.visible = asCubes;
    this.surface.group.visible = !asCubes;
    this.nearby.group.visible = !asCubes;
  }

  private recolour(shade: Shade | null): void {
    if (shade) this.tint.show(shade.columns, shade.range, mapTexture(shade.field));
    else this.tint.clear();
  }

  /** The overview leaves out what is shown column by column. */
  private cutHole({ region, grid }: HeightField): void {
    const { column_x, column_z, width, depth } = region;
    const size = grid.cell_size;
    this.surface.hole.set(column_x, column_z, column_x + width, column_z + depth).multiplyScalar(size);
  }

  private frame(whole: Laid): void {
    const { width, depth, cell_size } = this.model.grid;
    this.stage.frameBlock(new Vector3(width * cell_size, highestOf(whole), depth * cell_size), cell_size);
    this.framed = true;
    performance.mark("first picture");
  }

  /** Marks the column whose profile is open. */
  private placeMarker(whole: Laid): void {
    const column = this.look.column.get();
    this.marker.visible = column !== null;
    if (!column) return;
    const size = this.model.grid.cell_size;
    const [x, z] = [(column.column_x + 0.5) * size, (column.column_z + 0.5) * size];
    const top = elevationIn(whole, x, z);
    this.marker.scale.set(size * 0.3, top + 4 * size, size * 0.3);
    this.marker.position.set(x, this.marker.scale.y / 2, z);
  }

  private lookedAt(): void {
    const size = this.model.grid.cell_size;
    const { x, z } = this.middle();
    const whole = this.whole();
    if (whole && this.framed) this.stage.aim((x, z) => (covers(whole.field, x, z) ? elevationIn(whole, x, z) : null));
    this.model.lookAt(x / size, z / size);
    this.pictures.lookAt(x / size, z / size);
  }

  private meetSnow(ray: Ray): number | null {
    const whole = this.whole();
    if (!whole) return null;
    const { width, depth, cell_size: size } = this.model.grid;
    const box = { low: [0, 0, 0], high: [width * size, highestOf(whole) + size, depth * size] };
    return meetSurface(ray, box, this.elevations(whole), size / 2);
  }
}
