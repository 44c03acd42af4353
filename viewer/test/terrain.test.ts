// The ground under the snow in a real browser, on a real server.

import assert from "node:assert/strict";
import { test } from "node:test";
import { hills } from "../src/terrain/hills.ts";
import { colours, keep, open } from "./browser.ts";
import { greyPng } from "./png.ts";
import { browser, firn, server } from "./stage.ts";

type Page = Awaited<ReturnType<typeof open>>["page"];

const press = (page: Page, name: string) => page.getByRole("button", { name, exact: true }).click();
const live = (page: Page) => page.locator(".connection[data-state=open]").waitFor();

/** Opens the dialog and enters a grid, which begins paused. */
async function dialogFor(page: Page, name: string, fields: Record<string, number>) {
  await press(page, "New session");
  const dialog = page.getByRole("dialog");
  await dialog.getByLabel("Name").fill(name);
  for (const [name, value] of Object.entries(fields)) {
    await dialog.getByRole("spinbutton", { name }).fill(String(value));
  }
  await dialog.getByLabel("Begin paused").check();
  return dialog;
}

/** What a picture shows, in parts of its height from above. */
interface Sight {
  /** Highest place in the left and in the right third of what is drawn, and the lowest of all. */
  left: number;
  right: number;
  bottom: number;
  /** Whether it shows cells: the ground under them is lighter than the one under the surface. */
  cells: boolean;
}

async function look(page: Page): Promise<Sight> {
  const [columns, rows] = [60, 90];
  const points = await colours(page, ".picture canvas", columns, rows);
  const background = points[columns - 1] as number[];
  const drawn = (point: number[]) => point.some((value, i) => Math.abs(value - (background[i] as number)) > 12);
  // The legend lies over the lower left corner.
  const legend = (x: number, z: number) => x < 0.36 * columns && z > 0.8 * rows;
  const ends = Array.from({ length: columns }, (_, x) => {
    const column = Array.from({ length: rows }, (_, z) => !legend(x, z) && drawn(points[z * columns + x] as number[]));
    return [column.indexOf(true) / rows, column.lastIndexOf(true) / rows] as const;
  }).filter(([top]) => top >= 0);
  const third = Math.floor(ends.length / 3);
  const highest = (part: typeof ends) => Math.min(...part.map(([top]) => top), 1);
  return {
    left: highest(ends.slice(0, third)),
    right: highest(ends.slice(-third)),
    bottom: Math.max(...ends.map(([, bottom]) => bottom), 0),
    cells: points.some(([r = 0, g = 0, b = 0]) => r > 105 && r < 165 && r - b > 10 && r > g && g > b),
  };
}

/** Waits until the picture is as wanted. */
async function seen(page: Page, wanted: (sight: Sight) => boolean): Promise<Sight> {
  for (;;) {
    const sight = await look(page);
    if (wanted(sight)) return sight;
    await page.waitForTimeout(50);
  }
}

/** A ramp along x, from black to white, of 16 bits. */
function ramp(width: number, depth: number): number[] {
  return Array.from({ length: width * depth }, (_, i) => Math.round((65_535 * (i % width)) / (width - 1)));
}

const file = (buffer: Buffer) => ({ name: "terrain.png", mimeType: "image/png", buffer });

test("a session on hills: its ground, its surface, its cells, cut open", async () => {
  const { page, complaints } = await open(browser, server.url);
  const grid = { Width: 48, Depth: 40, Height: 12, Snow: 0.9 };
  const dialog = await dialogFor(page, "hills", grid);
  await dialog.getByLabel("Terrain").selectOption("Hills");
  await dialog.getByLabel("Relief").fill("3.5");
  await dialog.getByLabel("Seed").fill("7");
  await keep(page, "create-hills");
  await press(page, "Create");
  await live(page);
  const session = firn.session("hills");
  assert.deepEqual((await session.terrain()).heights, hills(48, 40, 3.5, 7));
  await page.getByText("From 0.0 to 3.5 m.").waitFor({ state: "attached" });
  await page.waitForFunction(() => performance.getEntriesByName("first picture").length > 0);
  await keep(page, "hills-surface");

  await page.locator("[name=colour]").selectOption("position");
  await page.locator(".legend").getByText("Position, m").waitFor();
  const labels = await page.locator(".legend .labels span").allTextContents();
  const highest = Number(labels.at(-1)?.replace(/[^\d.]/g, ""));
  assert.ok(highest > 3.2 && highest < 4.7, `${highest}`);
  await page.getByText("Cells", { exact: true }).click();
  const whole = await seen(page, ({ cells }) => cells);
  await keep(page, "hills-cells");
  await page.locator("[name=cut]").selectOption("z");
  await seen(page, ({ bottom }) => bottom < whole.bottom - 0.05);
  await keep(page, "hills-cut");
  await page.locator("[name=cut]").selectOption("y");
  await page.getByLabel("Place of the cut").fill("0.2");
  await seen(page, ({ left }) => left > whole.left + 0.05);
  await keep(page, "hills-cut-level");
  assert.deepEqual(complaints, []);
});

test("a session on an image, whose size the grid takes over, and another image under the snow", async () => {
  const { page, complaints } = await open(browser, server.url);
  const dialog = await dialogFor(page, "ramp", { Height: 8, Snow: 0.4 });
  await dialog.getByLabel("Terrain").selectOption("A PNG");
  await dialog.getByLabel("Image").setInputFiles(file(Buffer.from("not a picture, whatever its name says")));
  await dialog.getByText("This file is no PNG.").waitFor();
  await dialog.getByLabel("Image").setInputFiles(file(greyPng(36, 24, 16, ramp(36, 24))));
  await dialog.getByText("36 × 24 pixels of 16 bits. The grid has 50 × 50 columns").waitFor();
  await dialog.getByLabel("Black").fill("1200");
  await dialog.getByLabel("White").fill("1206");
  await press(page, "Create");
  await dialog.getByRole("alert").getByText("The grid has 50 × 50 columns").waitFor();
  await assert.rejects(firn.session("ramp").get(), { status: 404 });
  await keep(page, "create-image");
  await press(page, "Fit the grid to it");
  await press(page, "Create");
  await live(page);
  const session = firn.session("ramp");
  const { heights } = await session.terrain();
  assert.equal(heights.length, 36 * 24);
  for (const [x, metres] of [
    [0, 1200],
    [35, 1206],
  ] as const)
    assert.ok(Math.abs((heights[x] as number) - metres) < 1e-3);
  await seen(page, ({ left, right }) => left - right > 0.15);
  await keep(page, "ramp-surface");
  await page.getByText("Cells", { exact: true }).click();
  await seen(page, ({ cells, left, right }) => cells && left - right > 0.15);
  await keep(page, "ramp-cells");

  await page.getByText("Terrain", { exact: true }).click();
  await page.getByText("From 1200.0 to 1206.0 m.").waitFor();
  const fall = ramp(36, 24).map((grey) => 255 - (grey >> 8));
  await page.getByLabel("Image").setInputFiles(file(greyPng(36, 24, 8, fall)));
  await page.getByRole("spinbutton", { name: "Black" }).fill("0");
  await page.getByRole("spinbutton", { name: "White" }).fill("5");
  await press(page, "Put under the snow");
  await page.getByText("From 0.0 to 5.0 m.").waitFor();
  await seen(page, ({ left, right }) => right - left > 0.1);
  await page.getByText("Surface", { exact: true }).click();
  await seen(page, ({ left, right }) => right - left > 0.1);
  await keep(page, "ramp-turned");
  assert.deepEqual(complaints, []);
});

test("ground that the server refuses is told in the dialog, and no session is left", async () => {
  const { page } = await open(browser, server.url);
  const dialog = await dialogFor(page, "abyss", { "Cell size": 0.02, Height: 8, Snow: 0.1 });
  await dialog.getByLabel("Terrain").selectOption("Hills");
  await dialog.getByLabel("Relief").fill("2000");
  await press(page, "Create");
  await dialog.getByRole("alert").getByText("elevations range over 2000 m").waitFor();
  await assert.rejects(firn.session("abyss").get(), { status: 404 });
  await dialog.getByLabel("Relief").fill("2");
  await press(page, "Create");
  await live(page);
});

test("on a phone the choice of terrain is no wider than the screen", async () => {
  const options = { viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true };
  const { page, complaints } = await open(browser, server.url, options);
  const dialog = await dialogFor(page, "phone", {});
  for (const kind of ["Hills", "A PNG"]) {
    await dialog.getByLabel("Terrain").selectOption(kind);
    assert.equal(await dialog.evaluate(({ scrollWidth, clientWidth }) => scrollWidth - clientWidth), 0, kind);
    assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), 390, kind);
  }
  await keep(page, "phone-create");
  assert.deepEqual(complaints, []);
});
