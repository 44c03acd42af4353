// Colours that show a field: a colour map, and a value for each column.

import { DataTexture, FloatType, type IUniform, LinearFilter, RedFormat, Vector4 } from "three";
import { colourMap, type Field, type Range } from "../fields.ts";

/** A value for each column of a region. */
export interface ColumnValues {
  column_x: number;
  column_z: number;
  width: number;
  depth: number;
  /** Row by row; NaN where there is none. */
  values: Float32Array;
}

/** A colour map for shaders: values from 0 to 1 along u. */
export function mapTexture(field: Field): DataTexture {
  const texture = new DataTexture(colourMap(field), 256, 1);
  texture.minFilter = LinearFilter;
  texture.magFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

/** Where a value lies on a colour scale, from 0 to 1; −1 for none. */
export function onScale(value: number, { low, high }: Range): number {
  if (Number.isNaN(value)) return -1;
  return Math.min(1, Math.max(0, (value - low) / (high - low)));
}

/** The colours of a surface. */
export class Tint {
  readonly uniforms: Record<"map" | "values" | "valueRegion" | "columnSize", IUniform>;

  constructor(columnSize: number) {
    this.uniforms = {
      map: { value: null },
      values: { value: null },
      valueRegion: { value: new Vector4(0, 0, 0, 0) },
      columnSize: { value: columnSize },
    };
  }

  /** White from now on. */
  clear(): void {
    (this.uniforms.valueRegion.value as Vector4).set(0, 0, 0, 0);
  }

  /** Shows values from now on. */
  show(columns: ColumnValues, range: Range, map: DataTexture): void {
    const { map: mapUniform, values, valueRegion } = this.uniforms;
    const scaled = columns.values.map((value) => onScale(value, range));
    (values.value as DataTexture | null)?.dispose();
    const texture = new DataTexture(scaled, columns.width, columns.depth, RedFormat, FloatType);
    texture.needsUpdate = true;
    values.value = texture;
    mapUniform.value = map;
    (valueRegion.value as Vector4).set(columns.column_x, columns.column_z, columns.width, columns.depth);
  }
}

/** GLSL: the colour of a place on the surface [m]. */
export const tinting = /* glsl */ `
  uniform sampler2D map;
  uniform highp sampler2D values;
  uniform vec4 valueRegion;
  uniform float columnSize;

  vec3 tinted(vec3 plain, vec2 place) {
    vec2 column = floor(place / columnSize) - valueRegion.xy;
    if (column.x < 0.0 || column.y < 0.0 || column.x >= valueRegion.z || column.y >= valueRegion.w) return plain;
    float value = texelFetch(values, ivec2(column), 0).r;
    return value < 0.0 ? plain : texture(map, vec2(value * 0.996 + 0.002, 0.5)).rgb;
  }
`;
