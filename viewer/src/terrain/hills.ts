// Hills made of noise: smooth, and the same for the same seed.

import { extremes } from "../extremes.ts";

/** Each octave has half the wavelength of the one before, and this part of its height. */
const FADING = 0.4;
const OCTAVES = 5;
/** Shorter waves [columns] would be steps. */
const SHORTEST = 8;

/** Elevations from 0 to `relief` [m] for each of width × depth columns, row by row. */
export function hills(width: number, depth: number, relief: number, seed: number): Float32Array {
  const heights = new Float32Array(width * depth);
  let [wavelength, height] = [Math.max(SHORTEST, Math.max(width, depth) / 1.7), 1];
  for (let octave = 0; octave < OCTAVES && wavelength >= SHORTEST; octave++) {
    addWaves(heights, width, wavelength, height, seed + 7919 * octave);
    wavelength /= 2;
    height *= FADING;
  }
  const [low, high] = extremes(heights);
  const scale = relief / (high - low || 1);
  return heights.map((height) => (height - low) * scale);
}

/** Adds gradient noise: at each point of a lattice the ground has a slope drawn by lot, and is smooth in between. */
function addWaves(heights: Float32Array, width: number, wavelength: number, height: number, seed: number): void {
  const points = Math.ceil(width / wavelength) + 1;
  const rows = Math.ceil(heights.length / width / wavelength) + 1;
  const slopes = Array.from({ length: points * rows }, (_, i) => {
    const angle = (2 * Math.PI * lot(i % points, Math.floor(i / points), seed)) / 2 ** 32;
    return [Math.cos(angle), Math.sin(angle)] as const;
  });
  for (let i = 0; i < heights.length; i++) {
    const [x, z] = [(i % width) / wavelength, Math.floor(i / width) / wavelength];
    const [column, row] = [Math.floor(x), Math.floor(z)];
    const [dx, dz] = [x - column, z - row];
    const corner = (right: number, down: number) => {
      const [alongX, alongZ] = slopes[(row + down) * points + column + right] as readonly [number, number];
      return alongX * (dx - right) + alongZ * (dz - down);
    };
    const [u, v] = [ease(dx), ease(dz)];
    const back = corner(0, 0) + u * (corner(1, 0) - corner(0, 0));
    const front = corner(0, 1) + u * (corner(1, 1) - corner(0, 1));
    heights[i] = (heights[i] as number) + height * (back + v * (front - back));
  }
}

/** From 0 to 1 with neither slope nor curvature at the ends. */
function ease(at: number): number {
  return at * at * at * (at * (6 * at - 15) + 10);
}

/** A whole number below 2³², the same for the same place and seed. */
function lot(x: number, z: number, seed: number): number {
  let mixed = Math.imul(x, 0x27d4eb2d) ^ Math.imul(z, 0x165667b1) ^ Math.imul(seed, 0x9e3779b1);
  mixed = Math.imul(mixed ^ (mixed >>> 15), 0x85ebca6b);
  mixed = Math.imul(mixed ^ (mixed >>> 13), 0xc2b2ae35);
  return (mixed ^ (mixed >>> 16)) >>> 0;
}
