// Objects that move by themselves, are moved, and are snowed in, in a real browser.

import assert from "node:assert/strict";
import { test } from "node:test";
import { colours, keep } from "./browser.ts";
import { firn } from "./stage.ts";
import { becomes, dents, drawn, openSession, pointAt, press, row, soft } from "./steps.ts";

const shape = { type: "box", width: 0.6, depth: 0.6 } as const;

test("an object is told a velocity and a turn rate, and moves, turns and leaves a track", async () => {
  const { page, complaints } = await openSession("moving", soft);
  const session = firn.session("moving");
  await session.putCollider({ id: "sledge", mass: 400, shape, position: { x: 1.05, z: 3.25 } });
  await row(page, "sledge").locator(".pick").click();
  await page.getByLabel("Velocity east").fill("1");
  await page.getByLabel("Velocity east").press("Enter");
  await row(page, "sledge").getByText("moving at 1.00 m/s").waitFor();
  await becomes(page, "moving", "sledge", ({ position }) => position.x > 4);
  await keep(page, "moving");
  await page.getByLabel("Velocity east").fill("0");
  await page.getByLabel("Velocity east").press("Enter");
  const there = await becomes(page, "moving", "sledge", ({ velocity }) => !velocity);
  assert.ok(Math.abs(there.position.z - 3.25) < 1e-9);
  const track = await dents("moving", 32, 10, 40);
  assert.ok(
    track.every((dent) => dent > 0.05),
    `no gap: ${track}`,
  );
  await page.getByLabel("Turn rate").fill("20");
  await page.getByLabel("Turn rate").press("Enter");
  await row(page, "sledge").getByText("turning").waitFor();
  await becomes(page, "moving", "sledge", ({ heading }) => heading > 10);
  assert.deepEqual(complaints, []);
});

test("what is dragged or moved by keys leaves a track, and what is lifted leaves none", async () => {
  const { page, complaints } = await openSession("sweeping", soft);
  const session = firn.session("sweeping");
  await session.putCollider({ id: "block", mass: 400, shape, position: { x: 3.2, z: 3.2 } });
  await row(page, "block").waitFor();
  await drawn(page);
  await page.waitForTimeout(500);
  const drag = async (by: number) => {
    await page.mouse.down();
    await page.mouse.move(x + by, y, { steps: 1 });
    await page.mouse.up();
  };
  const [x, y] = await pointAt(page, 0.5, 0.46);
  await page.mouse.move(x, y);
  await drag(150);
  const far = await becomes(page, "sweeping", "block", ({ position, path }) => position.x > 4 && !path);
  await keep(page, "swept");
  const { heights } = await session.heights();
  const dentAt = (at: number) => {
    // Straight from where it stood to where it is.
    const place = (from: number, to: number) => Math.floor((from + (to - from) * at) / 0.1 + 1e-6);
    return (heights[0] as number) - (heights[64 * place(3.2, far.position.z) + place(3.2, far.position.x)] as number);
  };
  const track = [0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1].map(dentAt);
  assert.ok(
    track.every((dent) => dent > 0.05),
    `no gap: ${track}`,
  );

  // Keys: swept by a column, then lifted by one.
  const patched = () =>
    page.waitForRequest((request) => request.method() === "PATCH").then((request) => request.postDataJSON());
  const pick = row(page, "block").locator(".pick");
  const [swept] = await Promise.all([patched(), pick.press("ArrowRight")]);
  assert.equal(swept.sweep, true);
  const [lifted] = await Promise.all([patched(), pick.press("Shift+ArrowLeft")]);
  assert.deepEqual(Object.keys(lifted), ["position"]);
  await page.getByLabel("Lift objects").check();
  const [checked] = await Promise.all([patched(), pick.press("ArrowLeft")]);
  assert.deepEqual(Object.keys(checked), ["position"]);
  assert.deepEqual(complaints, []);
});

test("while the clock stands still a moved object is shown where it is going", async () => {
  const { page, complaints } = await openSession("waiting", { ...soft, paused: true });
  await firn.session("waiting").putCollider({ id: "block", mass: 400, shape, position: { x: 2.05, z: 3.25 } });
  const pick = row(page, "block").locator(".pick");
  // The second begins where the first will end, whether the page was told of that or not.
  await pick.press("ArrowRight");
  await pick.press("ArrowRight");
  await becomes(page, "waiting", "block", ({ path }) => Math.abs((path?.at(-1)?.[0] ?? 0) - 2.25) < 1e-9);
  await press(page, "Step");
  await becomes(page, "waiting", "block", ({ position, path }) => Math.abs(position.x - 2.25) < 1e-9 && !path);
  assert.deepEqual(complaints, []);
});

test("snow lies on an object as a white cap, unless it falls through", async () => {
  const grid = { width: 80, depth: 80, height: 20, cell_size: 0.1 };
  const { page, complaints } = await openSession("snowed-in", { grid, initial_snow: [{ depth: 0.4, density: 100 }] });
  const session = firn.session("snowed-in");
  const car = { type: "box", width: 1.8, depth: 4.2 } as const;
  await session.putCollider({ id: "car", mass: 1500, shape: car, position: { x: 4, z: 4 } });
  await row(page, "car").waitFor();
  await drawn(page);
  const brown = async () => {
    const points = await colours(page, ".picture canvas", 60, 60);
    return points.filter(([r = 0, , b = 0]) => r > 90 && r - b > 50).length;
  };
  let bare = 0;
  while (bare < 20) bare = await brown();
  await row(page, "car").locator(".pick").click();
  assert.ok(await page.locator(".burden").isHidden());
  await session.snowfall({ depth: 0.3, density: 80 });
  await page.locator(".burden", { hasText: "181 kg" }).waitFor();
  // Its top is white, its sides are not.
  for (;;) {
    const left = await brown();
    if (left > 0.1 * bare && left < 0.7 * bare) break;
  }
  await keep(page, "snowed-in");

  await page.getByLabel("Snow falls through it").check();
  await becomes(page, "snowed-in", "car", ({ shelters }) => !shelters);
  const before = (await session.collider("car")).burden;
  await session.snowfall({ depth: 0.1, density: 80 });
  assert.ok((await session.collider("car")).burden <= before);
  assert.deepEqual(complaints, []);
});
