// The sessions of the server: create, open, delete.

import type { Readiness, SessionView } from "firn-client";
import { h } from "../dom.ts";
import { clock, decimal, mass } from "../format.ts";
import type { Page } from "../main.ts";
import { isAlpine } from "../physics.ts";
import { askForToken, explain, server, wantsToken } from "../server.ts";
import { createDialog } from "./create.ts";

/** How often the list is asked for anew [ms]. */
const REFRESH = 2000;
/** More sessions than these are not listed here. */
const MOST = 200;

/** The page. */
export function listPage(): Page {
  document.title = "Firn";
  const facts = h("p", { class: "facts" });
  const notice = h("p", { class: "notice", role: "status" });
  const list = h("ul", { class: "sessions" });
  const enter = async () => {
    if (await askForToken(notice.textContent ?? "")) refresh();
  };
  const enterButton = h("button", { type: "button", hidden: true, click: enter }, "Enter a token");
  const state = { closed: false, timer: 0, asked: false };

  const refresh = async (): Promise<void> => {
    clearTimeout(state.timer);
    try {
      const [page, readiness] = await Promise.all([server().listSessions({ limit: MOST }), server().readiness()]);
      if (state.closed) return;
      facts.textContent = tell(readiness);
      show(list, page.items, report, refresh);
      tellBelow(page.next_cursor ? `These are the first ${MOST} sessions.` : empty(page.items), false);
    } catch (error) {
      await report(error);
    }
    if (!state.closed) state.timer = window.setTimeout(refresh, document.hidden ? 5 * REFRESH : REFRESH);
  };
  const report = async (error: unknown): Promise<void> => {
    if (state.closed) return;
    tellBelow(explain(error), wantsToken(error));
    if (!wantsToken(error) || state.asked) return;
    state.asked = true;
    await enter();
  };
  const tellBelow = (text: string, token: boolean): void => {
    notice.textContent = text;
    enterButton.hidden = !token;
  };

  const create = h("button", { type: "button", class: "primary", click: () => createDialog() }, "New session");
  const element = h(
    "main",
    { class: "list-page" },
    h("header", {}, h("h1", {}, "Firn"), h("p", {}, "Snowpacks, live"), create),
    list,
    notice,
    h("p", {}, enterButton),
    h("footer", {}, facts, h("p", {}, h("a", { href: "/docs" }, "API reference"))),
  );
  refresh();
  const close = () => {
    state.closed = true;
    clearTimeout(state.timer);
  };
  return { element, close };
}

function tell({ adapter, sessions, capacity }: Readiness): string {
  return `${sessions} of at most ${capacity} sessions, computed on ${adapter}`;
}

function empty(sessions: SessionView[]): string {
  return sessions.length === 0 ? "No sessions yet." : "";
}

/** Brings the list up to date; rows that stay keep the focus. */
function show(
  list: HTMLUListElement,
  sessions: SessionView[],
  report: (error: unknown) => void,
  refresh: () => void,
): void {
  const rows = new Map([...list.children].map((row) => [(row as HTMLElement).dataset["id"], row as HTMLElement]));
  for (const [index, session] of sessions.entries()) {
    const row = rows.get(session.id) ?? sessionRow(session.id, report, refresh);
    rows.delete(session.id);
    describe(row, session);
    if (list.children[index] !== row) list.insertBefore(row, list.children[index] ?? null);
  }
  for (const gone of rows.values()) gone.remove();
}

function sessionRow(id: string, report: (error: unknown) => void, refresh: () => void): HTMLElement {
  const remove = async () => {
    if (!confirm(`Delete the session “${id}” and its snow?`)) return;
    await server().session(id).delete().catch(report);
    refresh();
  };
  return h(
    "li",
    { "data-id": id },
    h(
      "a",
      { href: `#/sessions/${encodeURIComponent(id)}` },
      h("span", { class: "depth", "aria-hidden": "true" }, h("i", {})),
      h("strong", {}, id),
      h("span", { class: "what" }),
      h("span", { class: "state" }),
    ),
    h("button", { type: "button", class: "quiet", "aria-label": `Delete ${id}`, click: remove }, "Delete"),
  );
}

function describe(row: HTMLElement, session: SessionView): void {
  const { grid, summary } = session;
  const size = `${decimal(grid.width * grid.cell_size, 1)} × ${decimal(grid.depth * grid.cell_size, 1)} m`;
  const part = (name: string) => row.querySelector(name) as HTMLElement;
  const snow = isAlpine(session) ? "alpine snow" : "snow";
  part(".what").textContent = `${size}, ${decimal(summary.mean_height, 2)} m of ${snow}, ${mass(summary.total_mass)}`;
  const state = session.state === "running" && session.settled ? "settled" : session.state;
  part(".state").textContent = `${state} · ${clock(session)}`;
  part(".state").dataset["state"] = state;
  part(".depth i").style.height = `${Math.min(1, summary.mean_height / (grid.height * grid.cell_size)) * 100}%`;
}
