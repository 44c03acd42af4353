// Many boxes or cylinders in one draw: the cells of the grid, and the bodies on the snow.

import {
  type BufferGeometry,
  type DataTexture,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  Mesh,
  ShaderMaterial,
} from "three";
import { light, lighting, snowColour } from "./light.ts";

const vertexShader = /* glsl */ `
  attribute vec3 centre;
  attribute vec3 extent;
  attribute float value;
  varying vec3 vNormal;
  varying vec3 vOnFace;
  varying float vValue;
  void main() {
    vNormal = normalize(normal / extent);
    vOnFace = position;
    vValue = value;
    gl_Position = projectionMatrix * viewMatrix * vec4(centre + position * extent, 1.0);
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

/** One of the solids: its middle and its extent [m], and its value on the colour map from 0 to 1. */
export interface Solid {
  centre: readonly [number, number, number];
  extent: readonly [number, number, number];
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
    const [centre, extent, value] = ["centre", "extent", "value"].map(
      (name) => geometry.getAttribute(name) as InstancedBufferAttribute,
    ) as [InstancedBufferAttribute, InstancedBufferAttribute, InstancedBufferAttribute];
    for (const [i, solid] of solids.entries()) {
      centre.setXYZ(i, ...solid.centre);
      extent.setXYZ(i, ...solid.extent);
      value.setX(i, solid.value);
    }
    for (const attribute of [centre, extent, value]) attribute.needsUpdate = true;
    geometry.instanceCount = solids.length;
  }

  private makeRoom(room: number): void {
    const { geometry } = this.mesh;
    geometry.dispose();
    geometry.setAttribute("centre", new InstancedBufferAttribute(new Float32Array(3 * room), 3));
    geometry.setAttribute("extent", new InstancedBufferAttribute(new Float32Array(3 * room), 3));
    geometry.setAttribute("value", new InstancedBufferAttribute(new Float32Array(room), 1));
    this.room = room;
  }
}
