// One session: its picture, its controls, its profile.

import "../style/session.css";
import "../style/panel.css";
import "../style/pit.css";
import type { SessionView } from "firn-client";
import { h } from "../dom.ts";
import type { Page } from "../main.ts";
import { profileDrawer } from "../profile/drawer.ts";
import { hasWebGL } from "../scene/scene.ts";
import { askForToken, explain, server, wantsToken } from "../server.ts";
import { legend } from "../session/legend.ts";
import { Look } from "../session/look.ts";
import { Model } from "../session/model.ts";
import { Mover } from "../session/mover.ts";
import { panel } from "../session/panel/panel.ts";
import { Pictures } from "../session/picture.ts";
import { listen } from "../session/pointer.ts";
import { connection, facts, rates } from "../session/status.ts";
import { Viewport } from "../session/viewport.ts";

/** How long a message stays [ms]. */
const MESSAGE = 6000;

/** The page of a session. */
export async function sessionPage(id: string): Promise<Page> {
  document.title = `${id} · Firn`;
  const session = server().session(id);
  try {
    const view = await session.get();
    return livePage(new Model(session, view), view);
  } catch (error) {
    return problemPage(id, error);
  }
}

function livePage(model: Model, view: SessionView): Page {
  const look = new Look();
  const pictures = new Pictures(model, look);
  const message = h("p", { class: "message", role: "status" });
  let fading = 0;
  const say = (text: string) => {
    message.textContent = text;
    clearTimeout(fading);
    fading = window.setTimeout(() => message.replaceChildren(), MESSAGE);
  };
  // Who may only look is asked for a token that may do more.
  const report = (error: unknown) => (wantsToken(error) ? void enterToken(explain(error)) : say(explain(error)));
  const mover = new Mover(model, look, report);
  pictures.problem.watch((error) => error !== null && report(error));

  const canvas = h("canvas", {
    tabindex: 0,
    role: "img",
    "aria-label": `Snow of ${view.id} from above. Arrow keys turn it, plus and minus go closer and further away.`,
  });
  const viewport = hasWebGL() ? new Viewport(canvas, model, look, pictures) : null;
  const controls = panel({ model, look, mover, viewport, say, report });
  if (viewport) listen(viewport, model, look, mover, controls.tools);

  const state = connection(model, () => enterToken("The server wants a token for this session."));
  const speed = rates(model, viewport);
  const profile = profileDrawer(model, look, report);
  const header = h(
    "header",
    { class: "bar" },
    h("h1", {}, h("a", { href: "#/" }, "Firn"), h("span", {}, view.id)),
    state.element,
    facts(model),
    speed.element,
  );
  const picture = h("main", { class: "picture" }, viewport ? canvas : noPicture(), legend(pictures), profile, message);
  const element = h("div", { class: "session-page" }, header, picture, controls.element);
  const close = () => {
    for (const part of [state, speed, pictures, model]) part.close();
    viewport?.close();
  };
  return { element, close };
}

function noPicture(): HTMLElement {
  return h(
    "div",
    { class: "no-picture" },
    h("h2", {}, "No picture"),
    h(
      "p",
      {},
      "This browser offers no WebGL 2, which the picture is drawn with. It may be switched off, or the graphics driver may be ",
      "blocked. Everything else on this page works: controls, numbers, profiles.",
    ),
  );
}

function problemPage(id: string, error: unknown): Page {
  const retry = () => dispatchEvent(new HashChangeEvent("hashchange"));
  const token = () => enterToken(explain(error));
  const element = h(
    "main",
    { class: "list-page" },
    h("h1", {}, id),
    h("p", { class: "problem", role: "alert" }, explain(error)),
    h(
      "div",
      { class: "buttons" },
      wantsToken(error) ? h("button", { type: "button", class: "primary", click: token }, "Enter a token") : null,
      h("button", { type: "button", click: retry }, "Try again"),
      h("a", { href: "#/" }, "All sessions"),
    ),
  );
  return { element, close: () => {} };
}

async function enterToken(why: string): Promise<void> {
  if (await askForToken(why)) dispatchEvent(new HashChangeEvent("hashchange"));
}
