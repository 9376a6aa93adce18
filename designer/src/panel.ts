// The panel beside the stage: numbers with bands, the cells' sliders, what is selected.
import * as edit from "./edit";
import { bounds, centreOf } from "./geometry";
import { isCircle, type Cells, type Model, type Mould, type Ring, type Tether } from "./model";
import type { Design } from "./design";
import type { Numbers } from "./predict";
import type { Selection } from "./stage";

export const byId = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

function element<K extends keyof HTMLElementTagNameMap>(tag: K, about: object = {}, ...children: (Node | string)[]): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  Object.assign(made, about);
  made.append(...children);
  return made;
}

export function fillSelect(select: HTMLSelectElement, groups: Record<string, [string, string][]>): void {
  select.replaceChildren(...Object.entries(groups).flatMap(([label, options]) => {
    const made = options.map(([value, text]) => element("option", { value, textContent: text }));
    return label ? [element("optgroup", { label }, ...made)] : made;
  }));
}

export const words = (name: string) => name.replaceAll("_", " ");

interface Row { label: string; title: string; value: (n: Numbers) => number; text: (n: Numbers) => string; band?: (n: Numbers) => number | null; low: number; high: number }

const decimal = (value: number) => (Number.isFinite(value) ? value.toFixed(3) : "\u2013");

const ROWS: Row[] = [
  { label: "A/A\u2080", title: "area of the tissue over that as cast", value: (n) => n.ratios[0], text: (n) => decimal(n.ratios[0]), band: (n) => n.bands && n.bands[0], low: 0, high: 1 },
  { label: "w/w\u2080", title: "width across the middle (dotted line) over that as cast", value: (n) => n.ratios[1], text: (n) => decimal(n.ratios[1]), band: (n) => n.bands && n.bands[1], low: 0, high: 1 },
  { label: "alignment", title: "with the long side: 1 along it, -1 across", value: (n) => n.alignment, text: (n) => decimal(n.alignment), band: (n) => n.bands && n.bands[2], low: -1, high: 1 },
  { label: "anisotropy", title: "local alignment in any direction, 0 to 1", value: (n) => n.anisotropy, text: (n) => decimal(n.anisotropy), band: (n) => n.bands && n.bands[3], low: 0, high: 1 },
  { label: "posts held", title: "posts and bars that the tissue encloses, of those that it enclosed as cast", value: () => NaN, text: heldText, low: 0, high: 1 },
  { label: "cells", title: "cells in all layers", value: () => NaN, text: (n) => n.cells.toLocaleString("en"), low: 0, high: 1 },
];

function heldText({ held }: Numbers): string {
  const known = held.filter((share) => !Number.isNaN(share));
  if (!known.length) return "\u2013";
  const sum = known.reduce((total, share) => total + share, 0);
  return `${Number(sum.toFixed(1))} of ${known.length}`;
}

/** Writes the numbers of now, and of the design that is kept. */
export function showNumbers(now: Numbers | null, then: Numbers | null, isQuick: boolean, isStale: boolean): void {
  const body = byId("numbers");
  if (!body.childElementCount) {
    for (const row of ROWS) {
      const bar = Number.isNaN(row.value({ ratios: [0, 0] } as Numbers)) ? [] : [element("div", { className: "scale" }, element("i"), element("em"), element("em", { className: "then" }))];
      body.append(element("tr", { title: row.title }, element("td", { textContent: row.label }), element("td", {}, element("b"), element("span", { className: "pm" }), ...bar), element("td")));
    }
  }
  body.className = `${isQuick ? "quick" : ""} ${isStale ? "stale" : ""}`;
  ROWS.forEach((row, i) => {
    const [, cell, other] = body.children[i].children as unknown as HTMLElement[];
    const half = now && row.band ? row.band(now) : null;
    cell.querySelector("b")!.textContent = now ? row.text(now) : "\u2013";
    cell.querySelector(".pm")!.textContent = !row.band || !now ? "" : half === null ? "\u00b1 \u2026" : `\u00b1 ${half.toFixed(3)}`;
    other.textContent = then ? row.text(then) : "";
    const scale = cell.querySelector<HTMLElement>(".scale");
    if (!scale) return;
    const place = (value: number) => 100 * Math.min(1, Math.max(0, (value - row.low) / (row.high - row.low)));
    const mark = (node: HTMLElement, numbers: Numbers | null) => {
      const value = numbers ? row.value(numbers) : NaN;
      node.style.display = Number.isFinite(value) ? "" : "none";
      node.style.left = `${place(value)}%`;
    };
    const [band, tick, old] = scale.children as unknown as HTMLElement[];
    mark(tick, now);
    mark(old, then);
    band.style.display = now && half !== null ? "" : "none";
    if (now && half !== null) {
      band.style.left = `${place(row.value(now) - half)}%`;
      band.style.width = `${place(row.value(now) + half) - place(row.value(now) - half)}%`;
    }
  });
}

const CELLS: [keyof Cells, string, string][] = [
  ["delta", "\u0394", "strength with which cells contract the gel"],
  ["kappa_nnn", "\u03ba\u2099\u2099\u2099", "spring constant of the second kind of bond"],
  ["kappa_nnnn", "\u03ba\u2099\u2099\u2099\u2099", "spring constant of the third kind of bond"],
];

/** Sliders of the cells' parameters; `change` is called with each new set. */
export function cellSliders(model: Model, change: (cells: Cells, isDone: boolean) => void): (cells: Cells) => void {
  let now: Cells = { delta: 0, kappa_nnn: 0, kappa_nnnn: 0 };
  const inputs = CELLS.map(([name, symbol, title]) => {
    const { lower, upper } = model.bounds[name];
    const about = { min: String(lower), max: String(upper), step: "0.0001" };
    const slider = element("input", { type: "range", ...about, step: "0.005" }), number = element("input", { type: "number", ...about, step: "0.01" });
    for (const input of [slider, number]) input.setAttribute("aria-label", `${name}: ${title}`);
    const set = (text: string, isDone: boolean) => {
      const value = Number(text);
      if (text !== "" && Number.isFinite(value)) change(allowed({ ...now, [name]: value }, name, model), isDone);
    };
    slider.addEventListener("input", () => set(slider.value, false));
    slider.addEventListener("change", () => set(slider.value, true));
    number.addEventListener("change", () => set(number.value, true));
    byId("cells").append(element("label", { className: "slider", title }, element("span", { textContent: symbol }), slider, number));
    return [slider, number];
  });
  return (cells) => {
    now = cells;
    CELLS.forEach(([name], i) => inputs[i].forEach((input) => {
      if (document.activeElement !== input || input.type === "range") input.value = String(edit.rounded(cells[name], 1e-5));
    }));
  };
}

/** Cells within the range of training: the third spring constant is at most the second over the root of two. */
export function allowed(cells: Cells, changed: keyof Cells, model: Model): Cells {
  const found = { ...cells };
  for (const [name] of CELLS) found[name] = Math.min(model.bounds[name].upper, Math.max(model.bounds[name].lower, found[name]));
  if (found.kappa_nnnn > found.kappa_nnn / Math.SQRT2) {
    if (changed === "kappa_nnnn") found.kappa_nnn = Math.min(model.bounds.kappa_nnn.upper, found.kappa_nnnn * Math.SQRT2 + 1e-9);
    found.kappa_nnnn = Math.min(found.kappa_nnnn, Math.floor((found.kappa_nnn / Math.SQRT2) * 1e5) / 1e5);
  }
  return found;
}

/** The size of a mould in words. */
export function sizeOf(mould: Mould, mm: number | null, layers: number): string {
  const [x0, y0, x1, y1] = bounds(mould.outline), unit = mm ?? 1, text = (value: number) => Number((value * unit).toPrecision(3));
  return `${text(x1 - x0)} \u00d7 ${text(y1 - y0)} ${mm ? "mm" : "l\u2080"}, ${text(layers / Math.SQRT2)} deep`;
}

/** Numbers of what is selected, to be typed. */
export function inspect(design: Design, selection: Selection | null, change: (mould: Mould) => void): void {
  const box = byId("inspector"), { mould, mm, symmetry } = design, unit = mm ?? 1, called = mm ? "mm" : "l\u2080";
  if (box.contains(document.activeElement)) return;
  const field = (label: string, value: number, set: (value: number) => Mould) => {
    const input = element("input", { type: "number", step: "0.1", value: String(edit.rounded(value * unit, 1e-3)) });
    input.addEventListener("change", () => {
      const typed = Number(input.value);
      input.blur();
      if (input.value !== "" && Number.isFinite(typed)) change(set(edit.rounded(typed / unit)));
    });
    return element("label", {}, `${label}, ${called}`, input);
  };
  const say = (text: string) => element("p", { textContent: text });
  const { kind, index } = selection ?? { kind: "", index: -1 };
  if (kind === "corner" && mould.outline[index]) {
    const [x, y] = mould.outline[index];
    box.replaceChildren(say(`Corner ${index + 1} of ${mould.outline.length}`),
      field("x", x, (value) => edit.moveCorner(mould, index, [value, y], symmetry)), field("y", y, (value) => edit.moveCorner(mould, index, [x, value], symmetry)));
  } else if (kind === "tether" && mould.tethers[index]) {
    const tether = mould.tethers[index], [x, y] = centreOf(tether);
    const placed = (next: Tether) => edit.withTether(mould, index, next, symmetry);
    const sizes = isCircle(tether)
      ? [field("diameter", 2 * tether.radius, (value) => placed({ ...tether, radius: Math.max(0.4, value / 2) }))]
      : barFields(tether.polygon, field, placed);
    box.replaceChildren(say(`${isCircle(tether) ? "Post" : "Bar"} ${index + 1} of ${mould.tethers.length}`),
      field("x", x, (value) => placed(edit.shifted(tether, [value - x, 0]))), field("y", y, (value) => placed(edit.shifted(tether, [0, value - y]))), ...sizes);
  } else {
    box.replaceChildren(say(kind === "edge" ? `Wall ${index + 1}: drag it, or drag its dot to add a corner.` : "Select a corner, wall, post or bar to type its numbers."));
  }
}

function barFields(polygon: Ring, field: (label: string, value: number, set: (value: number) => Mould) => HTMLElement, placed: (next: Tether) => Mould): HTMLElement[] {
  const bar = edit.asRectangle(polygon);
  if (!bar) return [];
  const set = (about: Partial<edit.Rectangle>) => placed({ polygon: edit.rectangleRing({ ...bar, ...about }) });
  return [field("length", bar.length, (value) => set({ length: Math.max(value, bar.width) })), field("width", bar.width, (value) => set({ width: Math.min(Math.max(0.8, value), bar.length) }))];
}
