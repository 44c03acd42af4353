// Snow that is added, and that falls; the air above it.

import { action, h, numberField } from "../../dom.ts";
import { mass } from "../../format.ts";
import { isAlpine } from "../../physics.ts";
import { type Desk, section, setting } from "./panel.ts";

/** The section. */
export function snowSection(desk: Desk): HTMLElement {
  const { model, report, say } = desk;
  const { session } = model;
  const [depthField, depth] = numberField("Snow to add", "m", { value: 1.2, min: 0.001, max: 1000 });
  const add = async () => {
    if (!depth.reportValidity()) return;
    const { fallen_mass, refused_mass } = await session.snowfall({ depth: depth.valueAsNumber }, crypto.randomUUID());
    const refused = refused_mass > 0 ? `, ${mass(refused_mass)} of it found no room` : "";
    say(`${mass(fallen_mass)} fell${refused}.`);
    await model.refresh();
  };

  const [airField, air] = numberField("Air temperature", "°C", { min: -40, max: 0 });
  const showAir = setting(air, desk, (celsius) => session.setAirTemperature(celsius));
  const [rateField, rate] = numberField("Snowfall", "m/h", { min: 0, max: 100 });
  const showRate = setting(rate, desk, (snowfall_rate) => session.patch({ snowfall_rate }));
  model.view.watch((view) => {
    showAir(view.air_temperature);
    showRate(view.snowfall_rate);
    // Alpine snow has both from its weather.
    airField.hidden = isAlpine(view);
    rateField.hidden = isAlpine(view) && view.snowfall_rate === 0;
  });
  const button = action("Add snow", { class: "primary" }, add, report);
  return section("Snow", depthField, h("div", { class: "buttons" }, button), airField, rateField);
}
