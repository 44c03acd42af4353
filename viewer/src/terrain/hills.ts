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
  const alongX = new Float64Array(points * rows);
  const alongZ = new Float64Array(points * rows);
  for (let i = 0; i < points * rows; i++) {
    const angle = (2 * Math.PI * lot(i % points, Math.floor(i / points), seed)) / 2 ** 32;
    alongX[i] = Math.cos(angle);
    alongZ[i] = Math.sin(angle);
  }
  /** What the slope at a point of the lattice makes of the ground at a distance. */
  const rise = (point: number, dx: number, dz: number) =>
    (alongX[point] as number) * dx + (alongZ[point] as number) * dz;
  for (let i = 0; i < heights.length; i++) {
    const x = (i % width) / wavelength;
    const z = Math.floor(i / width) / wavelength;
    const point = Math.floor(z) * points + Math.floor(x);
    const dx = x - Math.floor(x);
    const dz = z - Math.floor(z);
    const u = ease(dx);
    const back = rise(point, dx, dz) * (1 - u) + rise(point + 1, dx - 1, dz) * u;
    const front = rise(point + points, dx, dz - 1) * (1 - u) + rise(point + points + 1, dx - 1, dz - 1) * u;
    heights[i] = (heights[i] as number) + height * (back + ease(dz) * (front - back));
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
