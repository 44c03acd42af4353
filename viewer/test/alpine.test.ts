// Alpine snow in a real browser, on a real server: its weather, its colours, its pit.

import assert from "node:assert/strict";
import { test } from "node:test";
import type { Route } from "playwright-core";
import { colours, dataset, keep, open } from "./browser.ts";
import { browser, firn, server } from "./stage.ts";
import { drawn, openSession, pointAt, press, type Spec } from "./steps.ts";

const site = { latitude: 45.3, longitude: 5.77, start: "2006-03-20T11:00:00Z" };
const mild = { air_temperature: 6, relative_humidity: 70, wind_speed: 3, cloud_cover: 0 };
const alpine: Spec = {
  physics: "alpine",
  grid: { width: 40, depth: 40, height: 40, cell_size: 0.1 },
  initial_snow: [
    { depth: 0.5, density: 380, temperature: -1 },
    { depth: 0.3, density: 250, temperature: -4 },
    { depth: 0.2, density: 120, temperature: -6 },
  ],
  site,
  weather: mild,
};

/** Gentle hills, so that columns differ in their sun. */
const hills = Float32Array.from(
  { length: 1600 },
  (_, i) => 0.5 - 0.3 * Math.cos((i % 40) / 6) * Math.cos(Math.floor(i / 40) / 7),
);

test("a session of alpine snow is created with its site and weather, and other fields than one of the thesis", async () => {
  const { page, complaints } = await open(browser, server.url);
  await press(page, "New session");
  const dialog = page.getByRole("dialog");
  const shown = (label: string) => dialog.getByLabel(label).isVisible();
  await dialog.getByLabel("Name").fill("glade");
  assert.ok((await shown("Kind of snow")) && !(await dialog.getByText("Latitude").isVisible()));
  await dialog.getByLabel("Physics").selectOption("alpine");
  assert.ok(!(await shown("Kind of snow")) && (await dialog.getByText("Latitude").isVisible()));
  const number = (name: string | RegExp) => dialog.getByRole("spinbutton", { name });
  assert.equal(await number(/^Air °C/).count(), 0);
  assert.equal(await number(/^Snow m/).inputValue(), "1");
  await number("Density").fill("300");
  await number("Latitude").fill("46.8");
  await number("Longitude").fill("9.8");
  await dialog.getByLabel("Start").fill("2006-01-15T12:00");
  await number("Weather step").fill("1800");
  await number("Time scale").fill("50000");
  await number("Air temperature").fill("-7.5");
  await number("Clouds").fill("40");
  await number("Snowfall").fill("1.5");
  await dialog.getByLabel("Begin paused").check();
  await keep(page, "create-alpine");

  // What the browser can't know is told by the server, beside the field.
  const spoil = async (route: Route) => {
    const body = { ...route.request().postDataJSON(), weather: { ...mild, wind_speed: 200 } };
    await route.continue({ postData: JSON.stringify(body) });
  };
  await page.route(`${server.url}/v1/sessions`, spoil, { times: 1 });
  await press(page, "Create");
  await dialog.getByText("expected 0 to 100 m/s, found 200").waitFor();
  assert.equal(await number(/^Wind m/).getAttribute("aria-invalid"), "true");
  await press(page, "Create");
  await page.locator(".connection[data-state=open]").waitFor();
  const view = await firn.session("glade").get();
  assert.deepEqual([view.physics, view.weather_step, view.time_scale], ["alpine", 1800, 50_000]);
  assert.deepEqual([view.site?.latitude, view.site?.longitude], [46.8, 9.8]);
  const { weather } = await firn.session("glade").weather();
  const given = { air_temperature: -7.5, relative_humidity: 80, wind_speed: 2, cloud_cover: 0.4 };
  assert.deepEqual(weather, { ...given, snowfall: 1.5, rainfall: 0 });
  await page.getByText("2006-01-15 12:00 UTC · paused").waitFor();
  await page.getByRole("link", { name: "Firn" }).click();
  await page.getByText("1.00 m of alpine snow").waitFor();
  assert.deepEqual(
    complaints.filter((complaint) => !complaint.includes("422")),
    [],
  );
});

test("the weather that holds is told, other weather is set, and what is refused is told at its field", async () => {
  const { page, complaints } = await openSession("weather", { ...alpine, weather: { ...mild, wind_direction: 315 } });
  const session = firn.session("weather");
  const section = page.locator("details", { has: page.getByText("Other weather") }).first();
  const number = (name: string | RegExp) => section.getByRole("spinbutton", { name });
  await section.getByText("It is 2006-03-20 11:00 UTC.").waitFor();
  await section.getByText("3.0 m/s, NW").waitFor();
  await section.getByText(/^4\d° high, S$/).waitFor();
  await section.getByText("Short wave worked out").waitFor();
  assert.equal(await number("Air temperature").inputValue(), "6");
  await keep(page, "weather");

  await number("Air temperature").fill("70");
  await press(page, "Set the weather");
  assert.ok(await section.locator("input:invalid").isVisible());
  await number("Air temperature").fill("-12.5");
  await number("Clouds").fill("100");
  await number("Snowfall").fill("4");
  await section.getByText("More", { exact: true }).click();
  assert.equal(await number("Wind from").inputValue(), "315");
  await number("Wind from").fill("90");
  await press(page, "Set the weather");
  await page.getByText("The weather holds from now on.").waitFor();
  await section.getByText("3.0 m/s, E").waitFor();
  await section.getByText("−12.5 °C").waitFor();
  const { weather } = await session.weather();
  const given = { air_temperature: -12.5, relative_humidity: 70, wind_speed: 3, cloud_cover: 1 };
  assert.deepEqual(weather, { ...given, snowfall: 4, rainfall: 0, wind_direction: 90 });
  // The air and the snowfall are the weather's: the other section has neither.
  assert.equal(await page.getByRole("spinbutton", { name: "Air temperature" }).count(), 1);
  assert.equal(await page.getByRole("spinbutton", { name: "Snowfall" }).count(), 1);

  const rows = [0, 3600].map((at) => ({ at, ...mild, air_temperature: -1 }));
  await session.putWeather({ series: rows, interpolate: false });
  await section.getByText("From a series of 2 rows.").waitFor();

  await page.getByLabel("Time scale").fill("100000");
  await page.getByLabel("Time scale").press("Enter");
  await press(page, "Start");
  await section.getByText(/^It is 2006-0[4-9]/).waitFor();
  assert.equal((await session.get()).time_scale, 100_000);
  assert.deepEqual(complaints, []);
});

test("without a site's place the short wave has to be told, which is said at its field", async () => {
  const { page } = await openSession("placeless", { ...alpine, site: {}, weather: { ...mild, shortwave: 250 } });
  const section = page.locator("details", { has: page.getByText("Other weather") }).first();
  await section.getByText("unknown").waitFor();
  await section.getByText("More", { exact: true }).click();
  const shortwave = section.getByRole("spinbutton", { name: "Short wave" });
  assert.equal(await shortwave.inputValue(), "250");
  await shortwave.fill("");
  await press(page, "Set the weather");
  await section.getByText("is missing and can't be worked out").waitFor();
  assert.equal(await shortwave.getAttribute("aria-invalid"), "true");
  await keep(page, "weather-refused");
  await shortwave.fill("100");
  await section.getByText("is missing").waitFor({ state: "detached" });
  await press(page, "Set the weather");
  await section.getByText("100 W/m²").waitFor();
});

test("colours show what the columns of alpine snow have, with a legend, on the surface and on cells", async () => {
  const { page, complaints } = await openSession("colours", alpine);
  await firn.session("colours").putTerrain(hills);
  await firn.session("colours").patch({ time_scale: 3600 });
  await firn.session("colours").step({ seconds: 3 * 3600 });
  await drawn(page);
  const legend = page.locator(".legend");
  for (const [name, unit] of [
    ["Skin temperature", "°C"],
    ["Snow water equivalent", "kg/m²"],
    ["Liquid water", "kg/m²"],
  ]) {
    await page.locator("[name=colour]").selectOption({ label: name as string });
    await legend.getByText(`${name}, ${unit}`).waitFor();
    await page.waitForTimeout(300);
    await keep(page, `alpine-${name?.split(" ")[0]?.toLowerCase()}`);
  }
  // Wet slopes are blue.
  const blue = async () => {
    const points = await colours(page, ".picture canvas", 40, 40);
    return points.filter(([r = 0, , b = 0]) => b - r > 60).length;
  };
  while ((await blue()) < 10);
  await page.getByText("Cells", { exact: true }).click();
  while ((await blue()) < 10);
  await keep(page, "alpine-cells");
  await page.locator("[name=colour]").selectOption("white");
  await legend.waitFor({ state: "hidden" });

  // They follow the snow, but are not asked for more often than each two seconds.
  const asked: number[] = [];
  page.on("request", (request) => {
    if (request.url().includes("quantity=")) asked.push(performance.now());
  });
  await page.getByText("Surface", { exact: true }).click();
  await page.locator("[name=colour]").selectOption("snow_water_equivalent");
  await press(page, "Start");
  while (asked.length < 3) await page.waitForTimeout(50);
  const pauses = asked.slice(1).map((at, i) => at - (asked[i] as number));
  assert.ok(Math.min(...pauses) > 1800, pauses.join());
  assert.deepEqual(complaints, []);
});

test("the pit of alpine snow has hand hardness and water, and facts of its column", async () => {
  const { page, complaints } = await openSession("pit", alpine);
  const session = firn.session("pit");
  await session.patch({ time_scale: 3600 });
  await session.step({ seconds: 4 * 3600 });
  await drawn(page);
  await page.mouse.click(...(await pointAt(page, 0.5, 0.45)));
  const pit = page.locator(".pit");
  await pit.waitFor();
  const column = await session.column(20, 20);
  assert.ok(column.layers.some(({ liquid_water }) => (liquid_water ?? 0) > 0));
  assert.deepEqual(await pit.locator("text.hardness:not(.title)").allTextContents(), ["F", "4F", "1F", "P", "K", "I"]);
  assert.equal(await pit.locator("rect.hardness").count(), column.layers.length);
  await pit.getByText("Water, %").waitFor();
  assert.match((await pit.getAttribute("aria-label")) ?? "", /hand hardness from the ground up: \w+/);
  const facts = page.locator(".profile .answers");
  for (const name of ["Snow water equivalent", "Skin temperature", "Albedo", "Run off so far"]) {
    await facts.getByText(name).waitFor();
  }
  await keep(page, "alpine-pit");
  // The sun sinks, and the profile with it, though no height changes while it stands.
  const told = await facts.textContent();
  await session.step({ seconds: 8 * 3600 });
  while ((await facts.textContent()) === told) await page.waitForTimeout(50);
  assert.deepEqual(complaints, []);
});

test("on a phone and in the dark alpine snow is no wider than the screen", async () => {
  const phone = { viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true, colorScheme: "dark" } as const;
  const { page, complaints } = await openSession("alpine-phone", alpine, phone);
  const fits = async () => assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), 390);
  await page.getByText("It is 2006-03-20").waitFor();
  await drawn(page);
  await fits();
  await page.getByText("Other weather").scrollIntoViewIfNeeded();
  await keep(page, "phone-weather");
  await page.evaluate(() => scrollTo(0, 0));
  await page.touchscreen.tap(...(await pointAt(page, 0.5, 0.45)));
  await page.locator(".pit").waitFor();
  await fits();
  await keep(page, "phone-alpine-pit");
  await page.getByLabel("Close the profile").tap();
  await page.goto(server.url);
  await press(page, "New session");
  const dialog = page.getByRole("dialog");
  await dialog.getByLabel("Physics").selectOption("alpine");
  assert.equal(await dialog.evaluate(({ scrollWidth, clientWidth }) => scrollWidth - clientWidth), 0);
  await fits();
  await keep(page, "phone-create-alpine");
  assert.deepEqual(complaints, []);
});

test("a session of the thesis has none of it", async () => {
  const { page, complaints } = await openSession("thesis");
  await dataset(page, ".bar .facts", "height", (height) => height > 0);
  assert.equal(await page.getByText("Weather").count(), 0);
  assert.equal(await page.locator("[name=colour] optgroup").count(), 0);
  assert.equal(await page.getByLabel("Time scale").getAttribute("max"), "1000");
  await press(page, "Profile");
  await page.locator(".pit").waitFor();
  await page.locator(".pit").getByText("Hardness, Pa").waitFor();
  assert.equal(await page.locator(".profile .answers dt").count(), 0);
  assert.deepEqual(complaints, []);
});
