// The decoder against the published test vectors.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import { DecodeError, decode } from "../src/height-stream.ts";

const path = new URL("../../../api/height-stream-vectors.json", import.meta.url);
const vectors = JSON.parse(readFileSync(path, "utf8"));
const bytes = (hex: string) => Uint8Array.from(Buffer.from(hex.replace(/\s/g, ""), "hex"));

for (const { name, hex, message } of vectors.messages) {
  test(name, () => {
    const decoded = decode(bytes(hex));
    const tiles = decoded.tiles.map((tile) => ({ ...tile, heights: [...tile.heights] }));
    const terrain = decoded.terrain.map((tile) => ({ ...tile, heights: [...tile.heights] }));
    assert.deepEqual({ ...decoded, tiles, terrain }, message);
  });
}

for (const { name, hex } of vectors.wrong) {
  test(`refused: ${name}`, () => {
    assert.throws(() => decode(bytes(hex)), DecodeError);
  });
}

test("a seq that a number can't hold exactly is refused", () => {
  // 2^53, as a varint.
  assert.throws(() => decode(bytes("0200028080808080808010010200")), /more than 53 bits/);
});

test("damaged messages are taken or refused, and nothing else", () => {
  let state = 1;
  const random = (below: number) => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return Math.floor((state / 2 ** 32) * below);
  };
  for (const { hex } of vectors.messages) {
    for (let i = 0; i < 300; i++) {
      const damaged = bytes(hex);
      damaged[random(damaged.length)] ^= 1 << random(7);
      try {
        decode(damaged.subarray(0, random(damaged.length + 1)));
      } catch (error) {
        assert(error instanceof DecodeError, String(error));
      }
    }
  }
});
