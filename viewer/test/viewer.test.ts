// The viewer in a real browser, on a real server.

import assert from "node:assert/strict";
import { randomBytes } from "node:crypto";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { Firn } from "../../clients/typescript/src/index.ts";
import { startServer } from "../../clients/typescript/test/server.ts";
import { describe, presets } from "../src/presets.ts";
import { colours, dataset, keep, open } from "./browser.ts";
import { browser, firn, server } from "./stage.ts";

type Page = Awaited<ReturnType<typeof open>>["page"];

const live = (page: Page) => page.locator(".connection[data-state=open]").waitFor();
const field = (page: Page, label: string) => page.getByLabel(label, { exact: false });
const press = (page: Page, name: string) => page.getByRole("button", { name, exact: true }).click();

/** Waits until the middle of the picture shows something else than its corner. */
async function picture(page: Page): Promise<void> {
  for (;;) {
    const points = await colours(page, ".picture canvas", 9, 9);
    const [corner, middle] = [points[8] as number[], points[40] as number[]];
    if (middle.some((value, channel) => Math.abs(value - (corner[channel] as number)) > 8)) return;
    await page.waitForTimeout(50);
  }
}

/** Creates a session and opens its page. */
async function openSession(id: string, spec: Parameters<Firn["createSession"]>[0] = {}) {
  await firn.createSession({ id, grid: { width: 32, depth: 32, height: 40 }, paused: true, ...spec });
  const tab = await open(browser, `${server.url}/#/sessions/${id}`);
  await live(tab.page);
  await picture(tab.page);
  return tab;
}

test("the dialog shows what a preset fills in, and the server fills in the same", async () => {
  const { page, complaints } = await open(browser, server.url);
  for (const [preset, snow] of Object.entries(presets)) {
    await press(page, "New session");
    const dialog = page.getByRole("dialog");
    await dialog.getByLabel("Name").fill(preset);
    await dialog.getByLabel("Kind of snow").selectOption(preset);
    await dialog.getByText(describe(snow)).waitFor();
    await dialog.getByLabel("Begin paused").check();
    await press(page, "Create");
    await live(page);
    const { material, air_temperature, pressing } = await firn.session(preset).get();
    const { name: _, air_temperature: shown, pressing: way, ...values } = snow;
    assert.deepEqual({ ...material, ...values }, material);
    assert.deepEqual([air_temperature, pressing], [shown, way]);
    await page.getByRole("link", { name: "Firn" }).click();
    await page.getByRole("button", { name: "New session" }).waitFor();
    await firn.session(preset).delete();
  }
  assert.deepEqual(complaints, []);
});

test("create a session, add snow, see it settle, delete the session", async () => {
  const { page, complaints } = await open(browser, server.url);
  await press(page, "New session");
  const dialog = page.getByRole("dialog");
  await dialog.getByLabel("Name").fill("ridge");
  await dialog.getByLabel("Width").fill("24");
  await dialog.getByLabel("Depth").fill("24");
  await dialog.getByRole("spinbutton", { name: "Snow" }).fill("3");
  await dialog.getByLabel("Begin paused").check();
  await press(page, "Create");
  await live(page);
  await picture(page);
  assert.equal(new URL(page.url()).hash, "#/sessions/ridge");

  await field(page, "Snow to add").fill("2.5");
  await press(page, "Add snow");
  await page.getByText(/ fell\./).waitFor();
  const fallen = await dataset(page, ".bar .facts", "height", (height) => height > 5.4);
  await field(page, "Time scale").fill("20");
  await field(page, "Time scale").press("Enter");
  await press(page, "Start");
  await dataset(page, ".bar .facts", "height", (height) => height < fallen - 0.3);
  await press(page, "Pause");
  await page.getByText("paused").waitFor();
  await field(page, "Step").fill("30");
  const { tick } = await firn.session("ridge").get();
  await press(page, "Step");
  await page.getByText(`Tick ${tick + 30}`).waitFor();

  await field(page, "Keep as").fill("settled");
  await press(page, "Keep this state");
  await page.getByText("Kept as settled.").waitFor();
  await press(page, "Step");
  await page.getByText(`Tick ${tick + 60}`).waitFor();
  await press(page, "Go back to settled");
  await page.getByText("Back to settled.").waitFor();
  assert.equal((await firn.session("ridge").get()).tick, tick + 30);
  await press(page, "Delete settled");
  await page.getByText("Go back").waitFor({ state: "detached" });

  await field(page, "Step").fill("1000000");
  await firn.session("ridge").patch({ snowfall_rate: 100 });
  await press(page, "Step");
  await press(page, "End the step");
  await page.getByText(/^Tick \d+\.$/).waitFor();

  await press(page, "Get mass");
  await page.getByText("0 quanta").waitFor();
  await press(page, "Get height");
  await page.locator(".answers dd", { hasText: " m" }).waitFor();
  await keep(page, "settling");

  await page.getByRole("link", { name: "Firn" }).click();
  await page.getByText("ridge").waitFor();
  await keep(page, "list");
  page.on("dialog", (question) => question.accept());
  await press(page, "Delete ridge");
  await page.getByText("No sessions yet.").waitFor();
  await assert.rejects(firn.session("ridge").get(), { status: 404 });
  assert.deepEqual(complaints, []);
});

test("put an object on the snow, see it sink, move it by hand and by keys, remove it", async () => {
  const { page, complaints } = await openSession("sledge", {
    paused: false,
    time_scale: 5,
    initial_snow: [{ depth: 5 }],
  });
  const session = firn.session("sledge");
  await field(page, "Mass").fill("1500");
  await page.getByLabel("Width", { exact: false }).fill("2.5");
  await page.getByLabel("Depth", { exact: false }).fill("2.5");
  await press(page, "Put in the middle");
  const row = page.locator(".objects li");
  await row.waitFor();
  const [put] = (await session.colliders()).items;
  assert.ok(put);
  assert.deepEqual(put.position, { x: 3.2, z: 3.2 });
  await dataset(page, ".objects li", "sink", (sink) => sink > 0.2);

  await row.locator("button").first().press("ArrowRight");
  const moved = async (x: number) => {
    for (;;) {
      const { position } = await session.collider(put.id);
      if (position.x > x) return position;
      await page.waitForTimeout(50);
    }
  };
  const right = await moved(3.3);
  assert.ok(Math.abs(right.x - 3.4) < 1e-9);

  const box = await page.locator(".picture canvas").boundingBox();
  assert.ok(box);
  const [x, y] = [box.x + box.width / 2, box.y + box.height * 0.33];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 60, y, { steps: 6 });
  await page.mouse.up();
  await moved(3.5);
  await keep(page, "object");

  await page.getByLabel("Show objects").uncheck();
  await press(page, `Remove ${put.id}`);
  await row.waitFor({ state: "detached" });
  assert.equal((await session.colliders()).items.length, 0);
  assert.deepEqual(complaints, []);
});

test("cells in colour with a legend, cut open, and the profile of a column with its weak layer", async () => {
  const initial_snow = [
    { depth: 2, density: 60 },
    { depth: 0.6, density: 25, temperature: -15 },
    { depth: 1.4, density: 50 },
  ];
  const { page, complaints } = await openSession("pit", { initial_snow });
  const legend = page.locator(".legend");
  for (const [name, unit] of [
    ["Density", "kg/m³"],
    ["Temperature", "°C"],
    ["Overpressure", "Pa"],
    ["Hardness", "Pa"],
    ["Position", "m"],
  ]) {
    await page.locator("[name=colour]").selectOption({ label: name as string });
    await legend.getByText(`${name}, ${unit}`).waitFor();
  }
  await page.locator("[name=colour]").selectOption("density");
  await page.getByText("Cells", { exact: true }).click();
  await page.locator("[name=cut]").selectOption("z");
  await legend.getByText("Density, kg/m³").waitFor();
  // The weak layer has the colour of the least value, viridis's dark violet, somewhere on the cut.
  for (;;) {
    const points = await colours(page, ".picture canvas", 40, 80);
    const violet = points.some(([r = 0, g = 0, b = 0]) => b > 60 && r > 40 && g < 40);
    const yellow = points.some(([r = 0, g = 0, b = 0]) => r > 180 && g > 180 && b < 90);
    if (violet && yellow) break;
  }
  await keep(page, "cells");

  await page.getByText("Surface", { exact: true }).click();
  await page.locator("[name=colour]").selectOption("white");
  await legend.waitFor({ state: "hidden" });
  const box = await page.locator(".picture canvas").boundingBox();
  assert.ok(box);
  await page.mouse.click(box.x + box.width * 0.5, box.y + box.height * 0.42);
  await page.locator(".pit").waitFor();
  const heading = await page.locator(".profile h2").textContent();
  const [x, z] = [...(heading ?? "").matchAll(/[\d.]+(?= m)/g)].map(([metres]) =>
    Math.floor(Number(metres) / 0.2 + 1e-6),
  );
  const column = await firn.session("pit").column(x as number, z as number);
  assert.equal(await page.locator(".pit rect.hardness").count(), column.layers.length);
  assert.equal(column.weak_layers.length, 1);
  assert.equal(await page.locator(".pit rect.weak").count(), 1);
  await keep(page, "profile");
  await page.getByLabel("Close the profile").click();
  await page.locator(".profile").waitFor({ state: "hidden" });
  assert.deepEqual(complaints, []);
});

test("the server is lost and comes back", async (t) => {
  const first = await startServer({ args: ["--backend", "cpu", "--demo"] });
  const { page, complaints } = await open(browser, `${first.url}/#/sessions/demo`);
  await live(page);
  await picture(page);
  await first.stop("SIGKILL");
  await page.locator(".connection[data-state=waiting]").waitFor();
  await page.getByText("Not connected").waitFor();
  await keep(page, "lost");
  const second = await startServer({ args: ["--backend", "cpu", "--demo"], port: first.port });
  t.after(() => second.stop());
  await live(page);
  const height = await dataset(page, ".bar .facts", "height", (height) => height > 0);
  await press(page, "Add snow");
  await dataset(page, ".bar .facts", "height", (now) => now > height + 0.5);
  // The browser itself tells of connections that it could not make; the page has nothing else to say.
  assert.deepEqual(
    complaints.filter((complaint) => !/ERR_CONNECTION|WebSocket connection/.test(complaint)),
    [],
  );
});

test("a large grid is watched coarsely, and closely around the middle", async () => {
  const grid = { width: 520, depth: 300, height: 8, cell_size: 0.5 };
  const { page, complaints } = await openSession("plain", { grid, initial_snow: [{ depth: 2 }] });
  await page.locator("[name=colour]").selectOption("density");
  await page.locator(".legend").getByText("Density").waitFor();
  await keep(page, "large");
  assert.deepEqual(complaints, []);
});

test("on a phone nothing is wider than the screen, in light and in dark", async () => {
  await firn.createSession({ id: "phone", paused: true, initial_snow: [{ depth: 4 }] });
  for (const colorScheme of ["light", "dark"] as const) {
    const { page, complaints } = await open(browser, server.url, {
      viewport: { width: 390, height: 844 },
      isMobile: true,
      hasTouch: true,
      colorScheme,
    });
    const fits = async () => assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), 390);
    await page.getByText("phone").waitFor();
    await fits();
    await page.getByText("phone").tap();
    await live(page);
    await picture(page);
    await keep(page, `phone-${colorScheme}`);
    const box = await page.locator(".picture canvas").boundingBox();
    assert.ok(box && box.width === 390);
    await page.touchscreen.tap(box.x + box.width / 2, box.y + box.height * 0.42);
    await page.locator(".pit").waitFor();
    await fits();
    await keep(page, `phone-profile-${colorScheme}`);
    assert.deepEqual(complaints, []);
  }
});

test("without WebGL it says so, and everything else works", async () => {
  await firn.createSession({ id: "blind", paused: true });
  const { page } = await open(browser, server.url);
  await page.addInitScript(() => {
    HTMLCanvasElement.prototype.getContext = () => null;
  });
  await page.goto(`${server.url}/?#/sessions/blind`);
  await page.getByText("This browser offers no WebGL 2").waitFor();
  await live(page);
  await press(page, "Add snow");
  await dataset(page, ".bar .facts", "height", (height) => height > 1);
  await press(page, "Profile");
  await page.locator(".pit").waitFor();
  await keep(page, "no-webgl");
});

test("a server with a key: a wrong token, the key, a session's token, a viewer's", async (t) => {
  const key = randomBytes(24).toString("hex");
  const guarded = await startServer({ args: ["--backend", "cpu"], env: { FIRN_API_KEY: key } });
  t.after(() => guarded.stop());
  const made = await new Firn(guarded.url, { token: key }).createSession({ id: "locked", paused: true });
  const enter = async (page: Page, token: string) => {
    await page.getByRole("textbox", { name: "Token" }).fill(token);
    await press(page, "Use it");
  };
  const height = (page: Page, wanted: (height: number) => boolean) => dataset(page, ".bar .facts", "height", wanted);

  const { page } = await open(browser, guarded.url);
  await page.getByRole("dialog").waitFor();
  await keep(page, "token");
  await enter(page, "open-sesame");
  await page.getByRole("dialog").waitFor({ state: "detached" });
  await press(page, "Enter a token");
  await enter(page, key);
  await press(page, "New session");
  await page.getByRole("dialog").getByLabel("Name").fill("second");
  await press(page, "Create");
  const told = page.getByRole("dialog").getByLabel("May only look");
  assert.match(await told.inputValue(), /^\S{20,}$/);
  await press(page, "Open it");
  await live(page);
  assert.ok(!page.url().includes(key));

  // Who has a session's token is sent straight to its page.
  const { page: owner } = await open(browser, `${guarded.url}/#/sessions/locked`);
  await press(owner, "Enter a token");
  await enter(owner, made.token);
  await live(owner);
  await press(owner, "Add snow");
  await height(owner, (height) => height > 1);

  const { page: guest } = await open(browser, `${guarded.url}/#/sessions/locked`);
  await press(guest, "Enter a token");
  await enter(guest, made.viewer_token);
  await live(guest);
  await picture(guest);
  await press(guest, "Add snow");
  await guest.getByRole("dialog").getByText("only allows reading").waitFor();
  await keep(guest, "token-viewer");
  await enter(guest, made.token);
  await live(guest);
  await press(guest, "Add snow");
  await height(guest, (height) => height > 2);

  // Tokens that are replaced end the streams that they opened.
  await new Firn(guarded.url, { token: key }).session("locked").renewTokens();
  await guest.locator(".connection[data-state=closed]").waitFor();
  await press(guest, "Enter a token");
  await enter(guest, key);
  await live(guest);
});

test("the API reference opens from the list, loads nothing from elsewhere and breaks no policy", async () => {
  const { page, complaints } = await open(browser, server.url);
  const foreign: string[] = [];
  page.on("request", (request) => {
    const { protocol, origin } = new URL(request.url());
    if (protocol !== "data:" && origin !== server.url) foreign.push(request.url());
  });
  await page.getByRole("link", { name: "API reference" }).click();
  await page.locator("#operations-tag-snow").waitFor();
  await page.goto(`${server.url}/docs/#/snow/get_render`);
  await page.reload();
  await page.locator("#operations-snow-get_render .parameters").first().waitFor();
  await keep(page, "reference");
  assert.deepEqual(foreign, []);
  // Swagger UI warns of a habit of its own.
  assert.deepEqual(
    complaints.filter((complaint) => !complaint.includes("escaping deep link")),
    [],
  );
});

const noDriver = process.env["FIRN_SKIP_GPU_TESTS"] === "1" && "needs a Vulkan driver";

test("a picture drawn by the server is saved", { skip: noDriver }, async () => {
  const { page, complaints } = await openSession("portrait", { initial_snow: [{ depth: 3 }] });
  const download = page.waitForEvent("download");
  await press(page, "Save a picture");
  const saved = await download;
  assert.equal(saved.suggestedFilename(), "portrait.png");
  const file = readFileSync(await saved.path());
  assert.equal(file.subarray(1, 4).toString(), "PNG");
  assert.deepEqual([file.readUInt32BE(16), file.readUInt32BE(20)], [1600, 1200]);
  assert.deepEqual(complaints, []);
});
