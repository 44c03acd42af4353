// The server that this page came from, and the token that it may ask for.

import { Firn, ProblemError } from "firn-client";
import { h } from "./dom.ts";

/** Forgotten with the tab, and never part of an address. */
const STORED = "firn-token";

/** The server, asked with the token that was entered. */
export function server(): Firn {
  return new Firn(location.origin, { token: sessionStorage.getItem(STORED) ?? undefined });
}

/** Whether the server refused for want of a token that does. */
export function wantsToken(error: unknown): boolean {
  return error instanceof ProblemError && (error.status === 401 || error.status === 403);
}

/** What went wrong, for people. */
export function explain(error: unknown): string {
  if (error instanceof ProblemError) return error.message;
  if (error instanceof TypeError) return "The server can't be reached.";
  return error instanceof Error ? error.message : String(error);
}

/** Asks for a token; true once one was entered. While it asks already, false at once. */
export async function askForToken(why: string): Promise<boolean> {
  if (document.querySelector("[name=token]")) return false;
  const input = h("input", {
    type: "password",
    name: "token",
    autocomplete: "off",
    required: true,
    "aria-label": "Token",
  });
  const dialog = h(
    "dialog",
    { class: "dialog", "aria-labelledby": "token-title" },
    h(
      "form",
      { method: "dialog" },
      h("h2", { id: "token-title" }, "Token"),
      h("p", {}, why),
      input,
      h("p", { class: "hint" }, "An API key, or the token of a session. This tab keeps it until it is closed."),
      h(
        "div",
        { class: "buttons" },
        h("button", { type: "button", click: () => dialog.close() }, "Cancel"),
        h("button", { value: "use", class: "primary" }, "Use it"),
      ),
    ),
  );
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => {
      const entered = dialog.returnValue === "use" && input.value !== "";
      if (entered) sessionStorage.setItem(STORED, input.value.trim());
      dialog.remove();
      resolve(entered);
    });
    document.body.append(dialog);
    dialog.showModal();
  });
}
