// Measures what docs/performance.md tells about the viewer: node viewer/test/measure.ts

import { Firn } from "../../clients/typescript/src/index.ts";
import { startServer } from "../../clients/typescript/test/server.ts";
import { launch, open } from "./browser.ts";

/** Objects on the snow, and how often each moves [Hz]. */
const OBJECTS = 20;
const RATE = 20;
/** How long frames are counted [s]. */
const SECONDS = 10;

const server = await startServer({ args: ["--demo", ...process.argv.slice(2)] });
const browser = await launch();
const firn = new Firn(server.url);
try {
  const first: number[] = [];
  let weight = 0;
  for (let round = 0; round < 5; round++) {
    const { page } = await open(browser, `${server.url}/#/sessions/demo`);
    const marks = () => performance.getEntriesByName("first picture").map(({ startTime }) => startTime);
    await page.waitForFunction(() => performance.getEntriesByName("first picture").length > 0);
    first.push(...(await page.evaluate(marks)));
    weight = await page.evaluate(() =>
      [...performance.getEntriesByType("navigation"), ...performance.getEntriesByType("resource")]
        .map((entry) => entry as PerformanceResourceTiming)
        .filter(({ name }) => !name.includes("/v1/"))
        .reduce((sum, { encodedBodySize }) => sum + encodedBodySize, 0),
    );
    await page.context().close();
  }
  await firn.session("demo").delete();
  const frames = await countFrames();
  const median = first.sort((a, b) => a - b)[2] as number;
  console.log(`first picture: ${median.toFixed(0)} ms after navigation began (median of ${first.length})`);
  console.log(`page: ${(weight / 1000).toFixed(0)} kB compressed`);
  console.log(`128 × 128 columns, ${OBJECTS} objects moved at ${RATE} Hz: ${frames}`);
} finally {
  await browser.close();
  await server.stop();
}

/** Frames per second, and the resolution that they are drawn at, while objects wander over the snow. */
async function countFrames(): Promise<string> {
  const grid = { width: 128, depth: 128, height: 30, cell_size: 0.2 };
  await firn.createSession({ id: "wide", grid, tick_rate: 20, initial_snow: [{ depth: 4 }] });
  const mover = firn.session("wide").stream();
  const middle = (grid.width * grid.cell_size) / 2;
  const place = (i: number, seconds: number) => {
    const [radius, angle] = [2 + 0.4 * i, i + seconds / (1 + 0.05 * i)];
    return { x: middle + radius * Math.cos(angle), z: middle + radius * Math.sin(angle) };
  };
  const move = () => {
    const put = Array.from({ length: OBJECTS }, (_, i) => ({
      id: `object-${i}`,
      mass: 150,
      shape: { type: "box" as const, width: 0.8, depth: 0.8 },
      position: place(i, performance.now() / 1000),
    }));
    if (mover.state.name === "open") mover.command("colliders.batch", { put }).catch(() => {});
  };
  const timer = setInterval(move, 1000 / RATE);
  const { page } = await open(browser, `${server.url}/#/sessions/wide`);
  await page.locator(".rates").waitFor();
  await page.waitForTimeout(3000);
  const drawn = () =>
    page.evaluate(() => {
      const { frames, at } = document.querySelector<HTMLElement>(".rates")?.dataset ?? {};
      return [Number(frames), Number(at)] as const;
    });
  const [before, begin] = await drawn();
  await page.waitForTimeout(1000 * SECONDS);
  const [after, end] = await drawn();
  const { width, height } = await page.evaluate(() => {
    const { width, height } = document.querySelector("canvas") as HTMLCanvasElement;
    return { width, height };
  });
  clearInterval(timer);
  mover.close();
  return `${((1000 * (after - before)) / (end - begin)).toFixed(1)} frames/s at ${width} × ${height} pixels`;
}
