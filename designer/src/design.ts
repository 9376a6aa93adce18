// A design: a mould, the cells in it and its scale; its history, and its text in the page's address.
import type { Symmetry } from "./edit";
import type { Cells, Model, Mould, Point, Tether } from "./model";
import { isCircle } from "./model";

export interface Design {
  name: string;
  mould: Mould;
  cells: Cells;
  tissue: string; // whose cells these are, or ""
  mm: number | null; // millimetres per l0
  symmetry: Symmetry;
}

const stripped = (ring: Point[]): Point[] => {
  const last = ring[ring.length - 1];
  return ring.length > 1 && last[0] === ring[0][0] && last[1] === ring[0][1] ? ring.slice(0, -1) : ring;
};

/** A mould of a GeoJSON feature in l0, as the package writes them. */
export function mouldOf(feature: any): Mould {
  const geometry = feature.geometry;
  const [outline, ...holes] = geometry.type === "MultiPolygon" ? geometry.coordinates[0] : geometry.coordinates;
  let tethers = feature.properties?.tethers ?? [];
  if (typeof tethers === "string") tethers = JSON.parse(tethers);
  return {
    outline: stripped(outline),
    tethers: [
      ...tethers.map((each: any): Tether => ("polygon" in each ? { polygon: stripped(each.polygon) } : { x: each.x, y: each.y, radius: each.radius })),
      ...holes.map((hole: Point[]): Tether => ({ polygon: stripped(hole) })),
    ],
  };
}

export function preset(model: Model, name: string, cells: Cells, tissue: string): Design {
  const { feature } = model.moulds.find((each) => each.name === name)!;
  return { name, mould: mouldOf(feature), cells, tissue, mm: feature.properties.mm_per_l0 ?? null, symmetry: "none" };
}

export function cellsOf(model: Model, tissue: string): Cells {
  const middle = { delta: 0.5, kappa_nnn: 0.5, kappa_nnnn: 0.3 };
  return { ...middle, ...model.tissues.find((each) => each.name === tissue)?.cells };
}

/** A design as text for an address. */
export function encoded(design: Design): string {
  const { name, mould, cells, tissue, mm, symmetry } = design;
  const compact = {
    n: name, o: mould.outline.flat(),
    t: mould.tethers.map((each) => (isCircle(each) ? [each.x, each.y, each.radius] : each.polygon.flat())),
    c: [cells.delta, cells.kappa_nnn, cells.kappa_nnnn], i: tissue, m: mm, s: symmetry,
  };
  const letters = String.fromCharCode(...new TextEncoder().encode(JSON.stringify(compact)));
  return btoa(letters).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
}

/** The inverse of `encoded`; null if the text is no design. */
export function decoded(text: string): Design | null {
  try {
    const bytes = Uint8Array.from(atob(text.replaceAll("-", "+").replaceAll("_", "/")), (letter) => letter.charCodeAt(0));
    const found = JSON.parse(new TextDecoder().decode(bytes));
    const pairs = (flat: number[]): Point[] => Array.from({ length: flat.length / 2 }, (_, i) => [flat[2 * i], flat[2 * i + 1]]);
    const tethers = found.t.map((each: number[]): Tether => (each.length === 3 ? { x: each[0], y: each[1], radius: each[2] } : { polygon: pairs(each) }));
    const [delta, kappa_nnn, kappa_nnnn] = found.c;
    const numbers = [...found.o, ...found.t.flat(), ...found.c];
    if (found.o.length < 6 || !numbers.every(Number.isFinite)) return null;
    return { name: String(found.n), mould: { outline: pairs(found.o), tethers }, cells: { delta, kappa_nnn, kappa_nnnn }, tissue: String(found.i), mm: found.m, symmetry: found.s };
  } catch {
    return null;
  }
}

/** What was done, step by step. */
export class History {
  private steps: Design[];
  private at = 0;

  constructor(first: Design) { this.steps = [first]; }

  get canUndo() { return this.at > 0; }
  get canRedo() { return this.at < this.steps.length - 1; }

  add(design: Design) {
    if (JSON.stringify(design) === JSON.stringify(this.steps[this.at])) return;
    this.steps = [...this.steps.slice(Math.max(0, this.at - 199), this.at + 1), design];
    this.at = this.steps.length - 1;
  }

  undo() { return this.steps[(this.at = Math.max(0, this.at - 1))]; }
  redo() { return this.steps[(this.at = Math.min(this.steps.length - 1, this.at + 1))]; }
}
