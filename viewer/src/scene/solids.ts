// Many solids of one form in one draw: the cells of the grid, and the bodies on the snow.

import {
  type BufferGeometry,
  type DataTexture,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  Mesh,
  ShaderMaterial,
} from "three";
import { light, lighting, snowColour } from "./light.ts";
import type { Turn } from "./outline.ts";

const vertexShader = /* glsl */ `
  attribute vec3 centre;
  attribute vec3 extent;
  attribute vec2 turn;
  attribute float value;
  varying vec3 vNormal;
  varying vec3 vOnFace;
  varying float vValue;

  /** From a solid's own axes, x to its right and z forward, to those of the world. */
  vec3 turned(vec3 own) {
    return vec3(own.x * turn.y + own.z * turn.x, own.y, own.z * turn.y - own.x * turn.x);
  }

  void main() {
    vNormal = turned(normalize(normal / extent));
    vOnFace = position;
    vValue = value;
    gl_Position = projectionMatrix * viewMatrix * vec4(centre + turned(position * extent), 1.0);
  }
`;

const fragmentShader = /* glsl */ `
  ${lighting}
  uniform sampler2D map;
  uniform float outlined;
  uniform float flatness;
  varying vec3 vNormal;
  varying vec3 vOnFace;
  varying float vValue;

  /** 1 on the edges of a face. Lines fade where faces are small on the screen. */
  float edge() {
    vec3 width = fwidth(vOnFace);
    vec3 near = smoothstep(vec3(0.5) - 1.2 * width, vec3(0.5) - 0.3 * width, abs(vOnFace)) * step(abs(vNormal), vec3(0.5));
    float small = max(width.x, max(width.y, width.z));
    return max(near.x, max(near.y, near.z)) * (1.0 - smoothstep(0.12, 0.4, small));
  }

  void main() {
    vec3 colour = texture(map, vec2(clamp(vValue, 0.0, 1.0) * 0.996 + 0.002, 0.5)).rgb;
    if (vValue > 1.5) colour = ${snowColour};
    if (vValue < -0.5) colour = ground;
    // The ground is one body.
    colour *= 1.0 - 0.2 * outlined * edge() * step(-0.5, vValue);
    vec3 shaded = lighted(colour, normalize(vNormal), 1.0, 1.0);
    gl_FragColor = vec4(mix(shaded, colour, flatness), 1.0);
  }
`;

/** Values of solids that show no field. */
export const WHITE = 2;
export const GROUND = -1;

/** One of the solids: its middle, its extent [m] and how it is turned, and its value on the colour map from 0 to 1. */
export interface Solid {
  centre: readonly [number, number, number];
  extent: readonly [number, number, number];
  turn?: Turn;
  value: number;
}

/** Solids of one shape, a shape of side 1 around 0. */
export class Solids {
  readonly mesh: Mesh<InstancedBufferGeometry, ShaderMaterial>;
  private room = 0;

  /** Cells are outlined, and shaded but a little, so that their colours can be read off the legend. */
  constructor(shape: BufferGeometry, asCells: boolean) {
    const geometry = new InstancedBufferGeometry();
    geometry.index = shape.index;
    for (const name of ["position", "normal"]) geometry.setAttribute(name, shape.getAttribute(name));
    const uniforms = {
      ...light,
      map: { value: null },
      outlined: { value: asCells ? 1 : 0 },
      flatness: { value: asCells ? 0.6 : 0 },
    };
    this.mesh = new Mesh(geometry, new ShaderMaterial({ uniforms, vertexShader, fragmentShader }));
    this.mesh.frustumCulled = false;
    this.show([]);
  }

  /** The colour map. */
  set map(map: DataTexture) {
    (this.mesh.material.uniforms["map"] as { value: DataTexture }).value = map;
  }

  /** Shows these and no others. */
  show(solids: readonly Solid[]): void {
    const { geometry } = this.mesh;
    if (solids.length > this.room || this.room === 0) this.makeRoom(Math.max(16, Math.ceil(solids.length * 1.25)));
    const attribute = (name: string) => geometry.getAttribute(name) as InstancedBufferAttribute;
    const [centre, extent] = [attribute("centre"), attribute("extent")];
    const [turn, value] = [attribute("turn"), attribute("value")];
    for (const [i, solid] of solids.entries()) {
      centre.setXYZ(i, ...solid.centre);
      extent.setXYZ(i, ...solid.extent);
      turn.setXY(i, solid.turn?.sin ?? 0, solid.turn?.cos ?? 1);
      value.setX(i, solid.value);
    }
    for (const attribute of [centre, extent, turn, value]) attribute.needsUpdate = true;
    geometry.instanceCount = solids.length;
  }

  dispose(): void {
    this.mesh.removeFromParent();
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }

  private makeRoom(room: number): void {
    const { geometry } = this.mesh;
    geometry.dispose();
    for (const [name, size] of Object.entries({ centre: 3, extent: 3, turn: 2, value: 1 })) {
      geometry.setAttribute(name, new InstancedBufferAttribute(new Float32Array(size * room), size));
    }
    this.room = room;
  }
}
