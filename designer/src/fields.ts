// What can be shown of a prediction: an image, its colours and its scale.
import type { Model } from "./model";
import type { Prediction } from "./predict";

export interface Shown { values: Float32Array; low: number; high: number; diverging: boolean; label: string; digits: number }

export const VIEWS: [string, string][] = [
  ["density", "Density"], ["tension", "Tension of a cell"], ["anisotropy", "Local alignment"],
  ["sxsx", "Along x (SxSx)"], ["sysy", "Along y (SySy)"], ["szsz", "Upright (SzSz)"],
  ["sxsy", "SxSy"], ["sxsz", "SxSz"], ["sysz", "SySz"], ["band", "95 % band of density"],
];

/** A round number no smaller than a value. */
function ceiling(value: number): number {
  if (!(value > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(value));
  return power * [1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10].find((step) => step * power >= value * 0.999)!;
}

export function shown(found: Prediction, fields: Float32Array, name: string, model: Model): Shown {
  const size = model.pixels ** 2, channel = model.fields.indexOf(name);
  const asCast = found.numbers.cells / found.depressionPixels;
  const at = (k: number, p: number) => fields[k * size + p];
  const perCell = (value: number, p: number) => value / Math.max(at(0, p), 0.25 * model.threshold);
  let value = (p: number) => at(0, p) / asCast;
  let label = "density, over that as cast", diverging = false, high = 0;
  if (name === "tension") {
    [value, label, diverging] = [(p) => perCell(at(1, p), p), "tension of a cell, \u03ba\u2080 l\u2080", true];
  } else if (name === "anisotropy") {
    [value, label, high] = [(p) => perCell(Math.hypot(at(2, p) - at(3, p), 2 * at(5, p)), p), "local alignment in the plane", 1];
  } else if (name === "band") {
    const half = found.deviation;
    [value, label] = [(p) => (half ? (1.96 * half[p]) / asCast : 0), "half width of the 95 % band of density"];
  } else if (channel > 4) {
    [value, label, diverging, high] = [(p) => perCell(at(channel, p), p), `mean ${LETTERS[name]} of a cell`, true, 0.5];
  } else if (channel > 1) {
    [value, label, high] = [(p) => perCell(at(channel, p), p), `mean ${LETTERS[name]} of a cell`, 1];
  }
  const values = new Float32Array(size);
  for (let p = 0; p < size; p++) values[p] = value(p);
  if (!high) {
    let most = 0;
    for (let p = 0; p < size; p++) if (at(0, p) > model.threshold) most = Math.max(most, Math.abs(values[p]));
    high = ceiling(most);
  }
  return { values, low: diverging ? -high : 0, high, diverging, label, digits: high < 0.1 ? 3 : 2 };
}

const LETTERS: Record<string, string> = { sxsx: "S\u2093\u00b2", sysy: "S\u1d67\u00b2", szsz: "S_z\u00b2", sxsy: "S\u2093S\u1d67", sxsz: "S\u2093S_z", sysz: "S\u1d67S_z" };

/** 256 colours, red, green and blue. */
export const palette = (hex: string) => Uint8Array.from({ length: hex.length / 2 }, (_, i) => parseInt(hex.slice(2 * i, 2 * i + 2), 16));
