// Paths and prints, by clicks and by keys, in a real browser.

import assert from "node:assert/strict";
import { test } from "node:test";
import { colours, keep } from "./browser.ts";
import { firn } from "./stage.ts";
import { becomes, drawn, openSession, pointAt, press, row, soft } from "./steps.ts";

const shape = { type: "box", width: 0.6, depth: 0.6 } as const;

test("the chosen object follows the points that were clicked", async () => {
  const { page, complaints } = await openSession("path", { ...soft, paused: true });
  await firn.session("path").putCollider({ id: "sledge", mass: 400, shape, position: { x: 1.05, z: 3.25 } });
  await row(page, "sledge").waitFor();
  await drawn(page);
  const click = async (across: number, down: number) => page.mouse.click(...(await pointAt(page, across, down)));
  await page.getByRole("radio", { name: "Path" }).check({ force: true });
  await page.getByText("Choose an object first.").waitFor();
  await row(page, "sledge").locator(".pick").click();
  await click(0.45, 0.55);
  await click(0.6, 0.5);
  await page.getByText("sledge: 2 points").waitFor();
  // A blue line is drawn. The edge is blue where the picture has the focus.
  const blue = async () => {
    const points = await colours(page, ".picture canvas", 80, 80);
    const inside = (i: number) => Math.min(i % 80, 79 - (i % 80), Math.floor(i / 80), 79 - Math.floor(i / 80)) > 1;
    return points.filter(([r = 0, , b = 0], i) => b - r > 55 && inside(i)).length;
  };
  while ((await blue()) < 5);
  await keep(page, "path");
  await page.keyboard.press("Escape");
  await page.getByText("sledge: Click where it should go.").waitFor();
  while ((await blue()) > 0);

  await click(0.45, 0.55);
  await click(0.6, 0.5);
  await page.getByLabel("Takes").fill("3");
  await page.getByLabel("Takes").press("Enter");
  await page.getByText("sledge goes as soon as the clock runs.").waitFor();
  const { path } = await firn.session("path").collider("sledge");
  assert.equal(path.length, 2);
  await row(page, "sledge").getByText("on its path").waitFor();
  await press(page, "Start");
  const [x, z] = path[1] as [number, number];
  const there = await becomes(page, "path", "sledge", ({ path }) => !path);
  assert.ok(Math.hypot(there.position.x - x, there.position.z - z) < 1e-6);
  await keep(page, "path-done");
  assert.deepEqual(complaints, []);
});

test("a path is made without a mouse", async () => {
  const { page, complaints } = await openSession("keys", soft);
  await firn.session("keys").putCollider({ id: "sledge", mass: 400, shape, position: { x: 1.05, z: 3.25 } });
  await row(page, "sledge").locator(".pick").press("Enter");
  await page.getByRole("radio", { name: "Profile" }).press("ArrowRight");
  await page.getByRole("radio", { name: "Put" }).press("ArrowRight");
  await page.getByLabel("To x").fill("2");
  await page.getByLabel("To z").fill("2.5");
  await page.getByLabel("To z").press("Enter");
  await page.getByText("sledge: 1 point,").waitFor();
  await page.getByLabel("Takes").fill("1");
  await page.locator("canvas").press("Enter");
  await page.getByText("sledge is on its way.").waitFor();
  await becomes(page, "keys", "sledge", ({ position }) => Math.hypot(position.x - 2, position.z - 2.5) < 1e-6);
  assert.deepEqual(complaints, []);
});

test("a print is pressed where somebody clicks: of a foot, and of a box", async () => {
  const { page, complaints } = await openSession("prints", { ...soft, paused: true });
  const session = firn.session("prints");
  const pressed = async () => {
    const { heights } = await session.heights();
    return heights.filter((height) => height < (heights[0] as number) - 0.02).length;
  };
  await drawn(page);
  await page.getByRole("radio", { name: "Print" }).check({ force: true });
  await page.mouse.click(...(await pointAt(page, 0.4, 0.52)));
  await page.getByText(/^The print is 0\.\d\d m deep\.$/).waitFor();
  const foot = await pressed();
  assert.ok(foot >= 2 && foot <= 12, `${foot} columns`);
  await page.getByRole("radio", { name: "Box" }).check({ force: true });
  assert.equal(await page.getByLabel("Load").inputValue(), "500");
  await page.getByLabel("Points to").fill("45");
  await page.getByLabel("At x").fill("4");
  await press(page, "Press the print");
  for (;;) {
    const box = (await pressed()) - foot;
    if (box > 80 && box < 130) break;
    await page.waitForTimeout(50);
  }
  await page.waitForTimeout(500);
  await keep(page, "prints");
  assert.deepEqual(complaints, []);
});

test("on a phone the tools are no wider than the screen", async () => {
  const phone = { viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true };
  const { page, complaints } = await openSession("small", { ...soft, paused: true }, phone);
  const position = { x: 3.2, z: 3.2 };
  await firn.session("small").putCollider({ id: "sledge", mass: 400, shape, position, velocity: { x: 1, z: 0 } });
  await row(page, "sledge").locator(".pick").tap();
  for (const tool of ["Path", "Print"]) {
    await page.getByText(tool, { exact: true }).tap();
    assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), 390);
    await keep(page, `phone-${tool.toLowerCase()}`);
  }
  assert.deepEqual(complaints, []);
});
