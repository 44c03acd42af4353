// What colours can show, the same as the server's pictures: names, units and colour maps.

import type { Cells, HeightsQuery } from "firn-client";

/** A quantity that colours show. */
export interface Field {
  name: string;
  unit: string;
  /** From the least to the greatest value. */
  colours: string[];
  /** Whether the middle of the colours is 0. */
  diverging?: boolean;
  /** The shortest range that the colours are spread over. */
  leastRange: number;
}

/** A quantity of cells. */
export interface CellField extends Field {
  /** What the server is asked for. */
  needs: string[];
  /** Values of all cells; NaN outside the snow. `elevation` [m] is that of the middle of a column's cell. */
  values(cells: Cells, elevation: (column: number, y: number) => number): Float32Array;
}

const plain = (name: "density" | "temperature" | "hardness" | "liquid_water") => (cells: Cells) =>
  Float32Array.from(cells.fields[name] ?? [], (value) => value ?? Number.NaN);

const viridis = "440154 482878 3e4989 31688e 26828e 1f9e89 35b779 6ece58 b5de2b fde725";
const plasma = "0d0887 46039f 7201a8 9c179e bd3786 d8576b ed7953 fb9f3a fdca26 f0f921";
// Without its darkest colours: the shape of what is nearly black can't be seen.
const magma = "440f76 721f81 9e2f7f cd4071 f1605d fd9668 feca8d fcfdbf";
const cividis = "00224e 123570 3b496c 575d6d 707173 8a8678 a59c74 c3b369 e1cc55 fee838";
const blues = "eef4f9 d3e3f0 aacde3 79b3d6 4b96c7 2878b3 125a97 083d71 062650";
const blueRed = "053061 2166ac 4393c3 92c5de d1e5f0 f7f7f7 fddbc7 f4a582 d6604d b2182b 67001f";

/** A quantity of columns. */
export interface ColumnField extends Field {
  /** What the server is asked for. */
  quantity: NonNullable<HeightsQuery["quantity"]>;
  /** What cells show instead of what their column has. */
  ofCells?: CellField;
}

/** Every quantity of cells, by the name that the API knows it by. */
export const fields = {
  density: {
    name: "Density",
    unit: "kg/m³",
    needs: ["density"],
    colours: viridis.split(" "),
    leastRange: 1,
    values: plain("density"),
  },
  temperature: {
    name: "Temperature",
    unit: "°C",
    needs: ["temperature"],
    colours: plasma.split(" "),
    leastRange: 1,
    values: plain("temperature"),
  },
  overpressure: {
    name: "Overpressure",
    unit: "Pa",
    needs: ["stress", "hardness"],
    colours: blueRed.split(" "),
    diverging: true,
    leastRange: 10,
    values: ({ fields }) =>
      Float32Array.from(
        fields.stress ?? [],
        (stress, i) => (stress ?? Number.NaN) - (fields.hardness?.[i] ?? Number.NaN),
      ),
  },
  hardness: {
    name: "Hardness",
    unit: "Pa",
    needs: ["hardness"],
    colours: magma.split(" "),
    leastRange: 10,
    values: plain("hardness"),
  },
  position: {
    name: "Position",
    unit: "m",
    needs: [],
    colours: cividis.split(" "),
    leastRange: 0.1,
    values: ({ width, height, content, origin }, elevation) =>
      Float32Array.from(content, (what, i) => {
        const row = Math.floor(i / width);
        const column = Math.floor(row / height) * width + (i % width);
        return what === "snow" ? elevation(column, origin.cell_y + (row % height)) : Number.NaN;
      }),
  },
} satisfies Record<string, CellField>;

/** Every quantity of the columns of alpine snow. */
export const columnFields = {
  skin_temperature: {
    name: "Skin temperature",
    unit: "°C",
    quantity: "skin_temperature",
    colours: plasma.split(" "),
    leastRange: 1,
  },
  snow_water_equivalent: {
    name: "Snow water equivalent",
    unit: "kg/m²",
    quantity: "snow_water_equivalent",
    colours: viridis.split(" "),
    leastRange: 2,
  },
  liquid_water: {
    name: "Liquid water",
    unit: "kg/m²",
    quantity: "liquid_water",
    colours: blues.split(" "),
    leastRange: 1,
    ofCells: {
      name: "Liquid water of each cell",
      unit: "kg/m²",
      needs: ["liquid_water"],
      colours: blues.split(" "),
      leastRange: 0.1,
      values: plain("liquid_water"),
    },
  },
} satisfies Record<string, ColumnField>;

/** What the colours show; white where they show nothing. */
export type Colour = keyof typeof fields | keyof typeof columnFields | "white";

/** The quantity of cells of that name, if it is one. */
export function cellField(colour: Colour): CellField | null {
  return colour in fields ? fields[colour as keyof typeof fields] : null;
}

/** The quantity of columns of that name, if it is one. */
export function columnField(colour: Colour): ColumnField | null {
  return colour in columnFields ? columnFields[colour as keyof typeof columnFields] : null;
}

/** The ends of a colour scale. Values beyond them have the colour of the end. */
export interface Range {
  low: number;
  high: number;
  /** Whether there are values beyond each end. */
  below: boolean;
  above: boolean;
}

/** One value in so many may lie beyond an end: a few extremes don't take all the colours. */
const BEYOND = 250;

/** What a field's colours are spread over: nearly all its values, 0 in the middle where the field has one. */
export function rangeOf(field: Field, values: Float32Array): Range {
  const sorted = values.filter((value) => !Number.isNaN(value)).sort();
  if (sorted.length === 0) return { low: 0, high: field.leastRange, below: false, above: false };
  const last = sorted.length - 1;
  const few = Math.floor(last / BEYOND);
  const [least, most] = [sorted[0] as number, sorted[last] as number];
  const [from, to] = [sorted[few] as number, sorted[last - few] as number];
  const missing = Math.max(0, field.leastRange - (to - from));
  const reach = Math.max(-from, to, field.leastRange / 2);
  const [low, high] = field.diverging ? [-reach, reach] : [from - missing / 2, to + missing / 2];
  const hair = 0.01 * (high - low);
  return { low, high, below: least < low - hair, above: most > high + hair };
}

/** A field's colours as pixels from the least to the greatest value: red, green, blue, opaque. */
export function colourMap(field: Field, count = 256): Uint8Array<ArrayBuffer> {
  const stops = field.colours.map((hex) => [0, 2, 4].map((at) => Number.parseInt(hex.slice(at, at + 2), 16)));
  const pixels = new Uint8Array(4 * count);
  for (let i = 0; i < count; i++) {
    const at = (i / (count - 1)) * (stops.length - 1);
    const first = Math.min(Math.floor(at), stops.length - 2);
    for (let channel = 0; channel < 3; channel++) {
      const [from, to] = [stops[first]?.[channel] ?? 0, stops[first + 1]?.[channel] ?? 0];
      pixels[4 * i + channel] = Math.round(from + (to - from) * (at - first));
    }
    pixels[4 * i + 3] = 255;
  }
  return pixels;
}
