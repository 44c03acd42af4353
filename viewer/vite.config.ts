import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";
import { defineConfig, type Plugin } from "vite";

/** Puts beside each built file the same compressed, which the server sends to those who understand it. */
function compressed(): Plugin {
  const compress = (folder: string) => {
    for (const entry of readdirSync(folder, { withFileTypes: true })) {
      const path = join(folder, entry.name);
      if (entry.isDirectory()) compress(path);
      else writeFileSync(`${path}.gz`, gzipSync(readFileSync(path), { level: 9 }));
    }
  };
  return { name: "compressed", apply: "build", writeBundle: ({ dir }) => compress(dir as string) };
}

export default defineConfig({
  base: "./",
  resolve: {
    alias: { "firn-client": fileURLToPath(new URL("../clients/typescript/src/index.ts", import.meta.url)) },
  },
  build: {
    target: "es2022",
    // Data URLs are not allowed on the page.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 800,
  },
  plugins: [compressed()],
  // `npm run dev` shows the sessions of a server on this machine.
  server: { proxy: { "^/(v1|readyz|docs)": { target: "http://127.0.0.1:8080", ws: true } } },
});
