// Grey images, as drawing programs and maps of the ground have them.

import { crc32, deflateSync } from "node:zlib";

/** A PNG of grey pixels, row by row, of 8 or 16 bits. */
export function greyPng(width: number, height: number, bits: 8 | 16, pixels: number[]): Buffer {
  const step = bits / 8;
  const rows = Buffer.alloc(height * (1 + width * step));
  for (const [i, grey] of pixels.entries()) {
    rows.writeUIntBE(grey, Math.floor(i / width) * (1 + width * step) + 1 + (i % width) * step, step);
  }
  const header = Buffer.alloc(13);
  header.writeUInt32BE(width, 0);
  header.writeUInt32BE(height, 4);
  header.writeUInt8(bits, 8);
  const signature = Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]);
  return Buffer.concat([signature, chunk("IHDR", header), chunk("IDAT", deflateSync(rows)), chunk("IEND")]);
}

function chunk(name: string, data: Buffer = Buffer.alloc(0)): Buffer {
  const named = Buffer.concat([Buffer.from(name), data]);
  const [length, check] = [Buffer.alloc(4), Buffer.alloc(4)];
  length.writeUInt32BE(data.length);
  check.writeUInt32BE(crc32(named));
  return Buffer.concat([length, named, check]);
}
