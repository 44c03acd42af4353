// Ways over the snow, each an arrow that lies on it.

import { BufferAttribute, BufferGeometry, Color, DoubleSide, Mesh, ShaderMaterial } from "three";
import type { Point } from "./motion.ts";

/** Half the width of an arrow's head, and its length, in halves of the line's width. */
const [HEAD_WIDTH, HEAD_LENGTH] = [2.4, 5];
/** At most so many parts are made of a way. */
const MOST = 1000;

/** Lines are equally wide on the screen, wherever they are: some 0.8 % of its height. They lie so far above the snow. */
const vertexShader = /* glsl */ `
  attribute vec2 aside;
  void main() {
    float halfWidth = 0.0026 * -(viewMatrix * vec4(position, 1.0)).z;
    vec3 place = position + halfWidth * vec3(aside.x, 0.8, aside.y);
    gl_Position = projectionMatrix * viewMatrix * vec4(place, 1.0);
  }
`;

const fragmentShader = /* glsl */ `
  uniform vec3 colour;
  void main() {
    gl_FragColor = vec4(colour, 0.85);
  }
`;

/** Some ways of one colour. */
export class Ways {
  readonly mesh: Mesh<BufferGeometry, ShaderMaterial>;
  private readonly size: number;

  /** `size` is the side of a cell [m]. */
  constructor(size: number, colour: number) {
    this.size = size;
    const uniforms = { colour: { value: new Color().setHex(colour).convertLinearToSRGB() } };
    const flat = { transparent: true, depthWrite: false, side: DoubleSide };
    this.mesh = new Mesh(new BufferGeometry(), new ShaderMaterial({ uniforms, vertexShader, fragmentShader, ...flat }));
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
  }

  /** Shows these and no others. `elevationAt` tells how high the snow is at a place [m]. */
  show(ways: Iterable<readonly Point[]>, elevationAt: (x: number, z: number) => number): void {
    const corners = [...ways].flatMap((way) => [...arrow(way, this.size)]);
    this.mesh.visible = corners.length > 0;
    if (!this.mesh.visible) return;
    const places = corners.flatMap(({ x, z }) => [x, elevationAt(x, z), z]);
    const asides = corners.flatMap(({ aside }) => aside);
    const { mesh } = this;
    mesh.geometry.dispose();
    mesh.geometry = new BufferGeometry();
    mesh.geometry.setAttribute("position", new BufferAttribute(new Float32Array(places), 3));
    mesh.geometry.setAttribute("aside", new BufferAttribute(new Float32Array(asides), 2));
  }
}

/** A corner of a triangle: a place on the way [m], and how far from there along x and z, in halves of the line's width. */
interface Corner {
  x: number;
  z: number;
  aside: [number, number];
}

/** The triangles of an arrow along some points. */
export function* arrow(way: readonly Point[], size: number): Generator<Corner> {
  const step = Math.max(size, lengthOf(way) / MOST);
  const last = way.findLastIndex((point, i) => i > 0 && distance(point, way[i - 1] as Point) > 0);
  for (const [i, to] of way.entries()) {
    const from = way[i - 1];
    const all = from ? distance(from, to) : 0;
    if (!from || all === 0) continue;
    const [dx, dz] = [(to[0] - from[0]) / all, (to[1] - from[1]) / all];
    const corner = (at: number, side: number, back = 0): Corner => {
      return { x: from[0] + dx * at, z: from[1] + dz * at, aside: [-dz * side - dx * back, dx * side - dz * back] };
    };
    const count = Math.ceil(all / step);
    for (let part = 0; part < count; part++) {
      const [a, b] = [(part / count) * all, ((part + 1) / count) * all];
      // The line ends where the head begins.
      const back = i === last && part === count - 1 ? HEAD_LENGTH : 0;
      yield* [corner(a, 1), corner(a, -1), corner(b, 1, back)];
      yield* [corner(b, 1, back), corner(a, -1), corner(b, -1, back)];
    }
    if (i !== last) continue;
    yield* [corner(all, 0), corner(all, HEAD_WIDTH, HEAD_LENGTH), corner(all, -HEAD_WIDTH, HEAD_LENGTH)];
  }
}

/** How long a way is [m]. */
export function lengthOf(way: readonly Point[]): number {
  return way.slice(1).reduce((sum, point, i) => sum + distance(way[i] as Point, point), 0);
}

function distance([x, z]: Point, [toX, toZ]: Point): number {
  return Math.hypot(toX - x, toZ - z);
}
