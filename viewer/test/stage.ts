// A server and a browser for the tests of a file. Importing it starts both before the first test.

import { after, afterEach, before } from "node:test";
import { Firn } from "../../clients/typescript/src/index.ts";
import { type Server, startServer } from "../../clients/typescript/test/server.ts";
import { launch } from "./browser.ts";

export let browser: Awaited<ReturnType<typeof launch>>;
export let server: Server;
/** A client of the server. */
export let firn: Firn;

before(async () => {
  server = await startServer({ args: ["--backend", "cpu"] });
  firn = new Firn(server.url);
  browser = await launch();
});

after(async () => {
  await browser?.close();
  await server?.stop();
});

// Pages that stay open go on drawing.
afterEach(async () => {
  await Promise.all(browser.contexts().map((context) => context.close()));
});
