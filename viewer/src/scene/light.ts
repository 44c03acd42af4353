// One light for everything: a low sun and a wide sky, the same on the surface, on cells and on bodies.

import { Color, type IUniform, Vector3 } from "three";

/** Colours of the picture, by day and by night. */
interface Theme {
  background: number;
  sun: number;
  sky: number;
  ground: number;
}

const day: Theme = { background: 0xdfe7ef, sun: 0xfff1de, sky: 0xb4c9df, ground: 0x8d877c };
const night: Theme = { background: 0x141b23, sun: 0xf3ece1, sky: 0x7d95b0, ground: 0x55524c };

/** Direction to the sun. */
export const toSun = new Vector3(-0.62, 0.5, 0.42).normalize();

/** Uniforms that all materials share. */
export const light: Record<"sun" | "sky" | "ground" | "toSun", IUniform> = {
  sun: { value: new Color() },
  sky: { value: new Color() },
  ground: { value: new Color() },
  toSun: { value: toSun },
};

/** Takes over the colours that the page is shown in; returns the background. */
export function applyTheme(dark: boolean): Color {
  const theme = dark ? night : day;
  const set = (uniform: IUniform, hex: number) => (uniform.value as Color).setHex(hex).convertLinearToSRGB();
  set(light.sun, theme.sun);
  set(light.sky, theme.sky);
  set(light.ground, theme.ground);
  return new Color(theme.background);
}

/** GLSL: what a surface of a colour looks like. `open` is how much sky it sees, `lit` how much sun. */
export const lighting = /* glsl */ `
  uniform vec3 sun;
  uniform vec3 sky;
  uniform vec3 ground;
  uniform vec3 toSun;

  vec3 lighted(vec3 colour, vec3 normal, float open, float lit) {
    float facing = max(dot(normal, toSun), 0.0);
    vec3 fromSky = sky * (0.62 + 0.2 * normal.y) * open;
    return colour * (fromSky + sun * 0.52 * facing * lit + 0.1);
  }
`;
