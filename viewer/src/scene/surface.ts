// The snow's surface, and the walls that it is cut off at.

import type { HeightField } from "firn-client";
import { BufferAttribute, BufferGeometry, DoubleSide, Group, Mesh, ShaderMaterial, Vector4 } from "three";
import { light, lighting, snowColour } from "./light.ts";
import { type Blocker, groundAt, LOOK, Relief, SHAPE } from "./relief.ts";
import { type Tint, tinting } from "./tint.ts";

const surfaceVertex = /* glsl */ `
  attribute vec2 place;
  attribute vec3 shape;
  attribute vec3 look;
  varying vec3 vNormal;
  varying vec3 vLook;
  varying vec2 vPlace;
  void main() {
    vNormal = vec3(shape.y, sqrt(max(0.0, 1.0 - dot(shape.yz, shape.yz))), shape.z);
    vLook = look;
    vPlace = place;
    gl_Position = projectionMatrix * viewMatrix * vec4(place.x, shape.x, place.y, 1.0);
  }
`;

const surfaceFragment = /* glsl */ `
  ${lighting}
  ${tinting}
  uniform vec4 hole;
  varying vec3 vNormal;
  varying vec3 vLook;
  varying vec2 vPlace;
  void main() {
    if (all(greaterThan(vPlace, hole.xy)) && all(lessThan(vPlace, hole.zw))) discard;
    vec3 snow = tinted(${snowColour}, vPlace);
    vec3 colour = mix(ground, snow, vLook.z);
    gl_FragColor = vec4(lighted(colour, normalize(vNormal), vLook.x, vLook.y), 1.0);
  }
`;

const wallVertex = /* glsl */ `
  attribute vec3 position3;
  attribute vec3 facing;
  attribute vec2 below;
  varying vec3 vNormal;
  varying vec2 vBelow;
  void main() {
    vNormal = facing;
    vBelow = below;
    gl_Position = projectionMatrix * viewMatrix * vec4(position3, 1.0);
  }
`;

const wallFragment = /* glsl */ `
  ${lighting}
  varying vec3 vNormal;
  varying vec2 vBelow;
  void main() {
    vec3 snow = mix(vec3(0.97, 0.99, 1.0), vec3(0.76, 0.87, 0.98), min(1.0, vBelow.x));
    vec3 colour = vBelow.y > 0.5 ? ground * 0.8 : snow;
    gl_FragColor = vec4(lighted(colour, vNormal, 1.2, 0.75), 1.0);
  }
`;

/** Squares across a strip of triangles. */
const STRIP = 6;

/** Sides of the block: direction they face. */
const SIDES = [
  [0, -1],
  [1, 0],
  [0, 1],
  [-1, 0],
] as const;

/** The surface of a field of heights. */
export class Surface {
  readonly group = new Group();
  /** Columns [m] that are left out, because another surface shows them. */
  readonly hole = new Vector4(0, 0, 0, 0);
  private readonly material: ShaderMaterial;
  private readonly wallMaterial: ShaderMaterial;
  private readonly plinth: number;
  private relief: Relief | null = null;
  private shown: { field: HeightField; key: string } | null = null;
  private geometry = new BufferGeometry();
  private walls = new BufferGeometry();

  private squares: { fine: BufferAttribute; coarse: BufferAttribute } | null = null;

  /** `plinth` is how far the ground reaches below 0 [m]. */
  constructor(tint: Tint, plinth: number) {
    this.plinth = plinth;
    const uniforms = { ...light, ...tint.uniforms, hole: { value: this.hole } };
    this.material = new ShaderMaterial({ uniforms, vertexShader: surfaceVertex, fragmentShader: surfaceFragment });
    const wall = { uniforms: { ...light }, vertexShader: wallVertex, fragmentShader: wallFragment, side: DoubleSide };
    this.wallMaterial = new ShaderMaterial(wall);
  }

  /** Shows a field's heights as they are now. */
  update(field: HeightField, ground: Float32Array | null, blockers: Blocker[]): void {
    const key = [field.column_x, field.column_z, field.width, field.depth].join();
    if (this.shown?.field !== field || this.shown.key !== key || !this.relief) {
      this.relief = new Relief(field);
      this.build(this.relief);
      this.shown = { field, key };
    }
    this.relief.update(field, ground, blockers);
    for (const name of ["shape", "look"]) (this.geometry.getAttribute(name) as BufferAttribute).needsUpdate = true;
    this.raiseWalls(this.relief, field, ground);
  }

  /** Draws every square, or four of them as one. */
  refine(fine: boolean): void {
    if (this.squares) this.geometry.setIndex(fine ? this.squares.fine : this.squares.coarse);
  }

  private build(relief: Relief): void {
    this.geometry.dispose();
    this.walls.dispose();
    this.group.clear();
    const { columns, rows, xs, zs } = relief;
    const place = new Float32Array(2 * columns * rows);
    for (let z = 0; z < rows; z++) {
      for (let x = 0; x < columns; x++) place.set([xs[x] as number, zs[z] as number], 2 * (z * columns + x));
    }
    this.geometry = new BufferGeometry();
    this.geometry.setAttribute("place", new BufferAttribute(place, 2));
    this.geometry.setAttribute("shape", new BufferAttribute(relief.shape, SHAPE));
    this.geometry.setAttribute("look", new BufferAttribute(relief.look, LOOK));
    this.squares = { fine: triangles(columns, rows, 1), coarse: triangles(columns, rows, 2) };
    this.geometry.setIndex(this.squares.fine);
    this.walls = wallGeometry(columns, rows);
    for (const [geometry, material] of [
      [this.geometry, this.material],
      [this.walls, this.wallMaterial],
    ] as const) {
      const mesh = new Mesh(geometry, material);
      mesh.frustumCulled = false;
      this.group.add(mesh);
    }
  }

  /** Each point of the edge has four vertices: snow from the surface to the ground, and ground below. */
  private raiseWalls(relief: Relief, field: HeightField, ground: Float32Array | null): void {
    const positions = this.walls.getAttribute("position3") as BufferAttribute;
    const below = this.walls.getAttribute("below") as BufferAttribute;
    const clamp = (at: number, samples: number) => Math.min(Math.max(at - 1, 0), samples - 1);
    let vertex = 0;
    for (const [facing] of SIDES.entries()) {
      for (const [x, z] of edge(facing, relief.columns, relief.rows)) {
        const [px, pz] = [relief.xs[x] as number, relief.zs[z] as number];
        const top = relief.at(x, z);
        const low = groundAt(field, ground, clamp(x, field.width), clamp(z, field.depth));
        for (const [y, depth, isGround] of [
          [top, 0, 0],
          [low, (top - low) / 6, 0],
          [low, 0, 1],
          [-this.plinth, 0, 1],
        ] as const) {
          positions.setXYZ(vertex, px, y, pz);
          below.setXY(vertex, depth, isGround);
          vertex++;
        }
      }
    }
    positions.needsUpdate = true;
    below.needsUpdate = true;
  }
}

/** Vertices along a side, by their column and row. */
function* edge(side: number, columns: number, rows: number): Generator<readonly [number, number]> {
  const alongX = side % 2 === 0;
  const count = alongX ? columns : rows;
  const fixed = side === 0 || side === 3 ? 0 : (alongX ? rows : columns) - 1;
  for (let i = 0; i < count; i++) yield alongX ? [i, fixed] : [fixed, i];
}

/** Two triangles for each square, in strips so narrow that a vertex is still at hand when the next row needs it. */
function triangles(columns: number, rows: number, step: number): BufferAttribute {
  const [xs, zs] = [every(columns, step), every(rows, step)];
  const Index = columns * rows > 0xffff ? Uint32Array : Uint16Array;
  const index = new Index(6 * (xs.length - 1) * (zs.length - 1));
  let at = 0;
  for (let strip = 0; strip < xs.length - 1; strip += STRIP) {
    const end = Math.min(strip + STRIP, xs.length - 1);
    for (let z = 0; z + 1 < zs.length; z++) {
      const [back, front] = [zs[z] as number, zs[z + 1] as number];
      for (let x = strip; x < end; x++) {
        const [left, right] = [xs[x] as number, xs[x + 1] as number];
        const [a, b] = [back * columns + left, front * columns + left];
        const [c, d] = [back * columns + right, front * columns + right];
        index.set([a, b, c, c, b, d], at);
        at += 6;
      }
    }
  }
  return new BufferAttribute(index, 1);
}

/** Every so many of a row of vertices, and the last. */
function every(count: number, step: number): number[] {
  const all = Array.from({ length: count }, (_, i) => i);
  return all.filter((i) => i % step === 0 || i === count - 1);
}

function wallGeometry(columns: number, rows: number): BufferGeometry {
  const points = 2 * (columns + rows);
  const facing = new Float32Array(12 * points);
  const index: number[] = [];
  let point = 0;
  for (const [side, [nx, nz]] of SIDES.entries()) {
    const count = side % 2 === 0 ? columns : rows;
    for (let i = 0; i < count; i++, point++) {
      for (let level = 0; level < 4; level++) facing.set([nx, 0, nz], 3 * (4 * point + level));
      if (i + 1 === count) continue;
      for (const level of [0, 2]) {
        const a = 4 * point + level;
        index.push(a, a + 1, a + 4, a + 4, a + 1, a + 5);
      }
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position3", new BufferAttribute(new Float32Array(12 * points), 3));
  geometry.setAttribute("facing", new BufferAttribute(facing, 3));
  geometry.setAttribute("below", new BufferAttribute(new Float32Array(8 * points), 2));
  geometry.setIndex(index);
  return geometry;
}
