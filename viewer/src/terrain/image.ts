// An image whose greys are elevations, and the fields that ask for it.

import type { Session } from "firn-client";
import { h, numberField } from "../dom.ts";

/** Columns of a grid, or pixels of an image. */
export interface Size {
  width: number;
  depth: number;
}

/** A grey image. */
interface GreyImage extends Size {
  bytes: ArrayBuffer;
  bits: number;
}

/** Lays ground under a session's snow. */
export type Lay = (session: Session) => Promise<unknown>;

/** Fields for an image and its elevations. */
export interface ImageFields {
  elements: HTMLElement[];
  /** Shows whether the image fits. */
  check(): void;
  /** What lays the image's ground; throws where there is none that fits. */
  read(): Lay;
}

/** Bytes of a PNG up to the kind of its pixels, and where in them that is told. */
const HEADER = 26;
const [WIDTH, DEPTH, BITS, COLOUR] = [16, 20, 24, 25];
const SIGNATURE = [0x89504e47, 0x0d0a1a0a];

/** The fields. `wanted` is the size of the grid; `follow` gives the grid another, where it can still have one. */
export function imageFields(wanted: () => Size, follow?: (size: Size) => void): ImageFields {
  let image: GreyImage | null = null;
  let problem = "Choose an image.";
  const file = h("input", { type: "file", name: "terrain-image", accept: "image/png", change: () => choose() });
  const [blackField, black] = numberField("Black", "m", { value: 0, min: -20_000, max: 20_000, required: true });
  const [whiteField, white] = numberField("White", "m", { value: 10, min: -20_000, max: 20_000, required: true });
  const told = h("p", { class: "hint", role: "status" }, "A pixel for each column, grey, 8 or 16 bits.");
  const fit = h(
    "button",
    { type: "button", hidden: true, click: () => image && follow?.(image) },
    "Fit the grid to it",
  );

  const choose = async () => {
    image = null;
    try {
      const [chosen] = file.files ?? [];
      if (!chosen) throw new Error("Choose an image.");
      image = readHeader(await chosen.arrayBuffer());
    } catch (error) {
      problem = (error as Error).message;
    }
    check();
  };
  const misfit = (): string => {
    if (!image) return problem;
    const { width, depth } = wanted();
    const fits = image.width === width && image.depth === depth;
    return fits ? "" : `The grid has ${width} × ${depth} columns, and each needs a pixel.`;
  };
  const check = () => {
    const size = image ? `${image.width} × ${image.depth} pixels of ${image.bits} bits. ` : "";
    told.textContent = size + misfit();
    fit.hidden = !follow || !image || misfit() === "";
  };
  const read = (): Lay => {
    const why = misfit();
    if (!image || why) throw new Error(`The image of the terrain: ${why}`);
    const { bytes, bits } = image;
    const [offset, rise] = [black.valueAsNumber, white.valueAsNumber - black.valueAsNumber];
    if (!(Math.abs(rise) > 0)) throw new Error("The image of the terrain: black and white need different elevations.");
    return (session) => session.putTerrainImage(bytes, rise / (2 ** bits - 1), offset);
  };
  const elements = [
    h("label", { class: "field wide" }, h("span", {}, "Image"), file),
    h("div", { class: "pairs" }, blackField, whiteField),
    told,
    fit,
  ];
  return { elements, check, read };
}

function readHeader(bytes: ArrayBuffer): GreyImage {
  const view = new DataView(bytes);
  if (view.byteLength < HEADER || SIGNATURE.some((word, i) => view.getUint32(4 * i) !== word)) {
    throw new Error("This file is no PNG.");
  }
  const [bits, colour] = [view.getUint8(BITS), view.getUint8(COLOUR)];
  if (colour !== 0 || (bits !== 8 && bits !== 16)) {
    throw new Error("The image has to be grey, without transparency, of 8 or 16 bits.");
  }
  return { bytes, bits, width: view.getUint32(WIDTH), depth: view.getUint32(DEPTH) };
}
