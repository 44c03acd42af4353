// Which page is shown: the list of sessions at `#/`, one of them at `#/sessions/its-name`.

import "./style/base.css";
import "./style/list.css";
import { listPage } from "./pages/list.ts";

/** A page; `close` ends what it keeps running. */
export interface Page {
  element: HTMLElement;
  close(): void;
}

let shown: Page | null = null;
let turn = 0;

async function show(): Promise<void> {
  const mine = ++turn;
  const name = /^#\/sessions\/(.+)$/.exec(location.hash)?.[1];
  const page = name === undefined ? listPage() : await openSession(decodeURIComponent(name));
  if (mine !== turn) return page.close();
  shown?.close();
  shown = page;
  document.body.replaceChildren(page.element);
}

/** The session's page brings three.js along, which the list does without. */
async function openSession(id: string): Promise<Page> {
  const before = shown?.element;
  // What is clicked now is meant for the coming page.
  before?.toggleAttribute("inert", true);
  try {
    const { sessionPage } = await import("./pages/session.ts");
    return await sessionPage(id);
  } finally {
    before?.toggleAttribute("inert", false);
  }
}

addEventListener("hashchange", show);
show();
