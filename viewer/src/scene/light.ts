// One light for everything: a low sun and a wide sky, the same on the surface, on cells and on bodies.

import { Color, type IUniform, Vector3 } from "three";

/** Colours of the picture, by day and by night. */
interface Theme {
  background: number;
  ground: number;
  /** How bright everything is. */
  exposure: number;
}

const day: Theme = { background: 0xd3dee9, ground: 0x9a9184, exposure: 1 };
const night: Theme = { background: 0x141b23, ground: 0x6b655c, exposure: 0.93 };

/** Direction to the sun. */
export const toSun = new Vector3(-0.5, 0.75, 0.43).normalize();

/** What snow looks like where it lies level in the sun. */
export const snowColour = "vec3(0.925, 0.94, 0.96)";

/** Uniforms that all materials share. */
export const light: Record<"exposure" | "ground" | "toSun", IUniform> = {
  exposure: { value: 1 },
  ground: { value: new Color() },
  toSun: { value: toSun },
};

/** Takes over the colours that the page is shown in; returns the background. */
export function applyTheme(dark: boolean): Color {
  const theme = dark ? night : day;
  (light.ground.value as Color).setHex(theme.ground).convertLinearToSRGB();
  light.exposure.value = theme.exposure;
  return new Color(theme.background);
}

/**
 * GLSL: what a surface of a colour looks like. `open` is how much sky it sees, `lit` how much sun. What lies level and open in the
 * sun has its very colour, as the legend shows it.
 */
export const lighting = /* glsl */ `
  uniform float exposure;
  uniform vec3 ground;
  uniform vec3 toSun;

  const vec3 sky = vec3(0.54, 0.6, 0.66);

  vec3 lighted(vec3 colour, vec3 normal, float open, float lit) {
    vec3 sun = (vec3(1.0) - sky) / toSun.y;
    float facing = max(dot(normal, toSun), 0.0);
    return colour * exposure * (sky * (0.78 + 0.22 * normal.y) * open + sun * facing * lit);
  }
`;
