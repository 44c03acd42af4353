// A real Chromium, without a window and with software graphics.

import { execFileSync } from "node:child_process";
import { fileURLToPath } from "node:url";
import { type Browser, type BrowserContextOptions, chromium, type Page } from "playwright-core";

const script = fileURLToPath(new URL("../../scripts/chromium", import.meta.url));
const screenshots = fileURLToPath(new URL("../screenshots/", import.meta.url));

/** Starts it. */
export function launch(): Promise<Browser> {
  const executablePath = execFileSync(script, { encoding: "utf8" }).trim();
  const args = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
  // Chromium refuses its sandbox to root.
  return chromium.launch({ executablePath, args, chromiumSandbox: process.getuid?.() !== 0 });
}

/** A page, and what it complained about. */
export interface Tab {
  page: Page;
  complaints: string[];
}

/** Opens an address. */
export async function open(browser: Browser, url: string, options: BrowserContextOptions = {}): Promise<Tab> {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...options });
  const page = await context.newPage();
  page.setDefaultTimeout(60_000);
  const complaints: string[] = [];
  page.on("console", (message) => {
    if (message.type() === "error" || message.type() === "warning") complaints.push(message.text());
  });
  page.on("pageerror", (error) => complaints.push(error.message));
  await page.goto(url);
  return { page, complaints };
}

/** Keeps a picture of the page, to be looked at. */
export async function keep(page: Page, name: string): Promise<void> {
  await page.screenshot({ path: `${screenshots}${name}.png` });
}

/** Colours of a grid of points over an element, row by row: red, green, blue. */
export async function colours(page: Page, selector: string, columns: number, rows: number): Promise<number[][]> {
  const png = await page.locator(selector).screenshot();
  const read = async ([data, columns, rows]: [string, number, number]): Promise<number[][]> => {
    const bytes = Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0));
    const image = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
    const context = new OffscreenCanvas(image.width, image.height).getContext("2d", { willReadFrequently: true });
    if (!context) throw new Error("no canvas");
    context.drawImage(image, 0, 0);
    return Array.from({ length: columns * rows }, (_, i) => {
      const x = ((i % columns) + 0.5) * (image.width / columns);
      const y = (Math.floor(i / columns) + 0.5) * (image.height / rows);
      return [...context.getImageData(x, y, 1, 1).data.slice(0, 3)];
    });
  };
  return page.evaluate(read, [png.toString("base64"), columns, rows] as [string, number, number]);
}

/** Waits until a number that an element carries in its dataset is as wanted; returns it. */
export async function dataset(
  page: Page,
  selector: string,
  name: string,
  wanted: (value: number) => boolean,
): Promise<number> {
  for (;;) {
    const text = await page.locator(selector).getAttribute(`data-${name}`);
    if (text !== null && wanted(Number(text))) return Number(text);
    await page.waitForTimeout(50);
  }
}
