// Elements in one expression.

type Child = Node | string | null | undefined | false;

/** Attributes; functions are event listeners, `true` sets an attribute without a value, `false` and `undefined` leave it out. */
export type Attributes = Record<string, string | number | boolean | undefined | ((event: never) => void)>;

/** An element with attributes, listeners and children. */
export function h<Tag extends keyof HTMLElementTagNameMap>(
  tag: Tag,
  attributes: Attributes = {},
  ...children: Child[]
): HTMLElementTagNameMap[Tag] {
  return fill(document.createElement(tag), attributes, children);
}

/** The same for SVG. */
export function svg<Tag extends keyof SVGElementTagNameMap>(
  tag: Tag,
  attributes: Attributes = {},
  ...children: Child[]
): SVGElementTagNameMap[Tag] {
  return fill(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);
}

function fill<Made extends Element>(element: Made, attributes: Attributes, children: Child[]): Made {
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(name, value as (event: Event) => void);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value !== undefined) element.setAttribute(name, String(value));
  }
  element.append(...children.filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

/** A number field with its label and unit. */
export function numberField(label: string, unit: string, attributes: Attributes): [HTMLLabelElement, HTMLInputElement] {
  const input = h("input", { type: "number", inputmode: "decimal", step: "any", ...attributes });
  return [h("label", { class: "field" }, h("span", {}, label), input, h("small", {}, unit)), input];
}

/** Choices of which one holds, as radio buttons that look like one control. */
export function choice<T extends string>(
  legend: string,
  options: readonly (readonly [T, string])[],
  chosen: T,
  onChoice: (value: T) => void,
): HTMLFieldSetElement {
  const name = `choice-${legend.toLowerCase().replace(/\W+/g, "-")}`;
  const buttons = options.map(([value, text]) =>
    h(
      "label",
      {},
      h("input", { type: "radio", name, value, checked: value === chosen, change: () => onChoice(value) }),
      h("span", {}, text),
    ),
  );
  return h("fieldset", { class: "choice" }, h("legend", { class: "hidden" }, legend), ...buttons);
}

/** Runs an action of a button; what goes wrong is told by `report`. The button rests meanwhile. */
export function action(
  label: string,
  attributes: Attributes,
  run: () => Promise<unknown>,
  report: (error: unknown) => void,
): HTMLButtonElement {
  const button = h("button", { type: "button", ...attributes }, label);
  button.addEventListener("click", async () => {
    button.disabled = true;
    try {
      await run();
    } catch (error) {
      report(error);
    } finally {
      button.disabled = false;
    }
  });
  return button;
}
