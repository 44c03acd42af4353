// What differs between the physics that snow can follow.

import type { Physics, SessionView } from "firn-client";

/** Every physics, by the name that the API knows it by; the first is the default. */
export const physics: Record<Physics, { name: string; highestTimeScale: number }> = {
  thesis: { name: "Thesis, without weather", highestTimeScale: 1000 },
  alpine: { name: "Alpine, with weather", highestTimeScale: 100_000 },
};

/** The physics of a session; that of the thesis where it says nothing. */
export function physicsOf({ physics }: Pick<SessionView, "physics">): Physics {
  return physics ?? "thesis";
}

/** Whether a session's snow feels the weather. */
export function isAlpine(session: Pick<SessionView, "physics">): boolean {
  return physicsOf(session) === "alpine";
}
