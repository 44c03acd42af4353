// Objects of every kind in a real browser, on a real server.

import assert from "node:assert/strict";
import { test } from "node:test";
import { keep } from "./browser.ts";
import { firn } from "./stage.ts";
import { becomes, openSession, press, row } from "./steps.ts";

test("each kind is put with a name that can be read, and the list says what it is", async () => {
  const { page, complaints } = await openSession("kinds");
  const kind = page.locator("[name=kind]");
  const stand = { box: "box 1 × 1 m", disk: "disk ⌀ 1 m", capsule: "capsule 1 × 1.5 m", wheel: "wheel ⌀ 1 m" };
  for (const [name, what] of Object.entries({ ...stand, walker: "2 × capsule", car: "4 × wheel" })) {
    await kind.selectOption(name);
    await page.getByLabel("Heading", { exact: false }).first().fill("30");
    await press(page, "Put in the middle");
    await row(page, `${name}-1`).getByText(what).waitFor();
    assert.equal((await firn.session("kinds").collider(`${name}-1`)).heading, 30);
  }
  const { shape, footprints, mass } = await firn.session("kinds").collider("car-1");
  assert.deepEqual([shape, footprints?.length, mass], [undefined, 4, 1500]);
  await press(page, "Put in the middle");
  await row(page, "car-2").waitFor();
  await page.locator("[name=object-name]").fill("hut 1");
  await press(page, "Put in the middle");
  assert.ok(await page.locator("[name=object-name]:invalid").isVisible());
  await page.locator("[name=object-name]").fill("hut");
  await press(page, "Put in the middle");
  await page.getByText("hut stands on the snow.").waitFor();
  await row(page, "hut").waitFor();
  assert.equal(await page.locator("[name=object-name]").inputValue(), "");
  await keep(page, "kinds");
  assert.deepEqual(complaints, []);
});

test("the chosen object is turned, held up, and hangs over the edge, and stays what it is", async () => {
  const { page, complaints } = await openSession("turning");
  const session = firn.session("turning");
  const shape = { type: "box", width: 1.2, depth: 0.4 } as const;
  await session.putCollider({ id: "plank", mass: 40, shape, position: { x: 0.3, z: 4 }, heading: 20 });
  const pick = row(page, "plank").locator(".pick");
  await pick.press("r");
  await becomes(page, "turning", "plank", ({ heading }) => heading === 35);
  await page.getByRole("slider", { name: "Turn it" }).fill("120");
  await becomes(page, "turning", "plank", ({ heading }) => heading === 120);

  await page.getByLabel("Held up").check();
  await becomes(page, "turning", "plank", ({ airborne }) => airborne);
  await row(page, "plank").locator("small", { hasText: "held up" }).waitFor();
  await keep(page, "held-up");
  await page.getByLabel("Held up").uncheck();
  await becomes(page, "turning", "plank", ({ pressure }) => pressure > 0);

  // The second step would end beyond the grid. The clock stands still, so it is lifted.
  await pick.press("Shift+ArrowLeft");
  await becomes(page, "turning", "plank", ({ position }) => position.x < 0.2);
  await pick.press("Shift+ArrowLeft");
  const plank = await becomes(page, "turning", "plank", ({ position }) => position.x === 0);
  assert.deepEqual([plank.shape, plank.heading, plank.position.z, plank.airborne], [shape, 120, 4, false]);
  assert.deepEqual(complaints, []);
});

test("an object with several footprints is lifted as one", async () => {
  const { page, complaints } = await openSession("dragging");
  await page.locator("[name=kind]").selectOption("car");
  await press(page, "Put in the middle");
  await row(page, "car-1").waitFor();
  const before = await firn.session("dragging").collider("car-1");
  await page.waitForTimeout(1000); // until it is drawn
  const box = await page.locator(".picture canvas").boundingBox();
  assert.ok(box);
  const [x, y] = [box.x + box.width / 2, box.y + box.height * 0.48];
  await page.mouse.move(x, y);
  await page.keyboard.down("Shift");
  await page.mouse.down();
  await page.mouse.move(x + 80, y, { steps: 6 });
  await page.mouse.up();
  await page.keyboard.up("Shift");
  const after = await becomes(page, "dragging", "car-1", ({ position }) => position.x > before.position.x + 0.3);
  assert.deepEqual([after.footprints, after.mass], [before.footprints, before.mass]);
  await keep(page, "car");
  assert.deepEqual(complaints, []);
});
