// What the tests of a session's page do again and again.

import type { Collider, Firn } from "../../clients/typescript/src/index.ts";
import { open, type Tab } from "./browser.ts";
import { browser, firn, server } from "./stage.ts";

type Page = Tab["page"];
export type Spec = NonNullable<Parameters<Firn["createSession"]>[0]>;

/** Presses a button. */
export const press = (page: Page, name: string) => page.getByRole("button", { name, exact: true }).click();

/** The row of an object in the list. */
export const row = (page: Page, id: string) => page.locator(`.objects li[data-id="${id}"]`);

/** Creates a session and opens its page. */
export async function openSession(id: string, spec: Spec = {}, options: Parameters<typeof open>[2] = {}): Promise<Tab> {
  await firn.createSession({
    id,
    paused: true,
    grid: { width: 40, depth: 40, height: 20 },
    initial_snow: [{ depth: 1 }],
    ...spec,
  });
  const tab = await open(browser, `${server.url}/#/sessions/${id}`, options);
  await tab.page.locator(".connection[data-state=open]").waitFor();
  return tab;
}

/** Waits until an object is as wanted. */
export async function becomes(page: Page, session: string, id: string, wanted: (collider: Collider) => boolean) {
  for (;;) {
    const collider = await firn.session(session).collider(id);
    if (wanted(collider)) return collider;
    await page.waitForTimeout(50);
  }
}

/** Snow of 6.4 m × 6.4 m that gives way at once, while the clock runs. */
export const soft: Spec = {
  grid: { width: 64, depth: 64, height: 20, cell_size: 0.1 },
  preset: "game",
  pressing: 0,
  paused: false,
  tick_rate: 20,
};

/** How deep the columns of a row were pressed, from one to another [m]. The first column of all is untouched. */
export async function dents(session: string, z: number, from: number, to: number): Promise<number[]> {
  const { heights } = await firn.session(session).heights();
  const all = Array.from(heights, (height) => (heights[0] as number) - height);
  return all.slice(64 * z + from, 64 * z + to);
}

/** A point of the picture on the screen, from 0 to 1 across and down. */
export async function pointAt(page: Page, across: number, down: number): Promise<[number, number]> {
  const box = await page.locator(".picture canvas").boundingBox();
  if (!box) throw new Error("no picture");
  return [box.x + across * box.width, box.y + down * box.height];
}

/** Waits until the first picture was drawn. */
export async function drawn(page: Page): Promise<void> {
  await page.waitForFunction(() => performance.getEntriesByName("first picture").length > 0);
}
