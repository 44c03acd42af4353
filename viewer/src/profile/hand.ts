// Hand hardness: what can just be pushed into the snow.

import type { HandHardness, Layer } from "firn-client";

/** Every class, from the softest on. */
export const hands: readonly HandHardness[] = ["F", "4F", "1F", "P", "K", "I"];

/** What each stands for. */
export const handNames: Record<HandHardness, string> = {
  F: "fist",
  "4F": "four fingers",
  "1F": "one finger",
  P: "pencil",
  K: "knife",
  I: "ice",
};

/** How far a class is from nothing: 1 for a fist, 6 for ice. */
export function rank(hand: HandHardness): number {
  return hands.indexOf(hand) + 1;
}

/** Classes from the ground up, each told once where several layers on end have it. */
export function runs(layers: readonly Layer[]): string {
  const all = layers.map(({ hand_hardness: hand }) => (hand ? handNames[hand] : ""));
  return all.filter((name, i) => name !== all[i - 1]).join(", ");
}

/** Liquid water of a layer, as a part of its volume [%]. */
export function wetness({ liquid_water: water, thickness }: Layer): number {
  return thickness > 0 ? (100 * (water ?? 0)) / (1000 * thickness) : 0;
}
