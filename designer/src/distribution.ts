// Distance of a mould and its cells from the training set: the twin of raptor.surrogate.out_of_distribution.
import { boxes } from "./images";
import { pixelSize, type Cells, type Model } from "./model";
import type { Cast } from "./cast";

export function descriptors(cast: Cast, cells: Cells, model: Model): number[] {
  const size = pixelSize(model);
  const count = (mask: Uint8Array) => mask.reduce((sum, each) => sum + each, 0);
  const [short, long] = principalAxes(cast.depression, model);
  const extents = boxes(cast.tethers, model.pixels).map(([rows, columns]) => size * Math.hypot(rows, columns));
  const scaled = (["delta", "kappa_nnn", "kappa_nnnn"] as const).map((name) => {
    const { lower, upper } = model.bounds[name];
    return (cells[name] - lower) / (upper - lower);
  });
  return [
    ...scaled, size * Math.sqrt(count(cast.depression)), 4 * long, Math.log(long / short), Math.sqrt(extents.length),
    size * Math.sqrt(count(cast.tethers)), Math.max(0, ...extents),
  ];
}

function principalAxes(mask: Uint8Array, model: Model): [number, number] {
  const pixels = model.pixels, size = pixelSize(model);
  let n = 0, x = 0, y = 0, xx = 0, yy = 0, xy = 0;
  for (let p = 0; p < mask.length; p++) {
    if (!mask[p]) continue;
    const i = size * ((p % pixels) - pixels / 2), j = size * (Math.floor(p / pixels) - pixels / 2);
    n += 1; x += i; y += j; xx += i * i; yy += j * j; xy += i * j;
  }
  if (n < 3) return [1, 1];
  const [a, b, c] = [xx - (x * x) / n, yy - (y * y) / n, xy - (x * y) / n].map((sum) => sum / (n - 1));
  const middle = (a + b) / 2, apart = Math.hypot((a - b) / 2, c);
  return [Math.max(1e-3, Math.sqrt(Math.max(0, middle - apart))), Math.max(1e-3, Math.sqrt(middle + apart))];
}

const trained = new WeakMap<Model, { points: number[][]; low: number[]; high: number[]; deviation: number[] }>();

function training(model: Model) {
  let found = trained.get(model);
  if (!found) {
    const bytes = Uint8Array.from(atob(model.calibration.points), (letter) => letter.charCodeAt(0));
    const numbers = Array.from(new Float32Array(bytes.buffer)), width = model.descriptors.length;
    const points = Array.from({ length: numbers.length / width }, (_, i) => numbers.slice(i * width, (i + 1) * width));
    const columns = model.descriptors.map((_, k) => points.map((point) => point[k]));
    const mean = columns.map((column) => column.reduce((sum, v) => sum + v, 0) / column.length);
    found = {
      points,
      low: columns.map((column) => column.reduce((a, b) => Math.min(a, b))),
      high: columns.map((column) => column.reduce((a, b) => Math.max(a, b))),
      deviation: columns.map((column, k) => Math.sqrt(column.reduce((sum, v) => sum + (v - mean[k]) ** 2, 0) / column.length) + 1e-6),
    };
    trained.set(model, found);
  }
  return found;
}

/** Distance to the nearest training sample over the usual one, and what is most unusual, in words. */
export function unusual(point: number[], model: Model): { distance: number; words: string } {
  const { points, low, high, deviation } = training(model);
  let least = Infinity, nearest = points[0];
  for (const other of points) {
    let square = 0;
    for (let k = 0; k < point.length; k++) square += ((point[k] - other[k]) / deviation[k]) ** 2;
    if (square < least) { least = square; nearest = other; }
  }
  const distance = Math.sqrt(least) / model.calibration.usual_distance;
  const excess = point.map((value, k) => Math.max(low[k] - value, value - high[k]) / deviation[k]);
  const largest = (values: number[]) => values.indexOf(Math.max(...values));
  let k = largest(excess);
  const text = (value: number) => quantity(model, k, value);
  const { unit } = model.descriptors[k];
  if (excess[k] > 0) {
    const lowest = unit ? text(low[k]).replace(new RegExp(` ${unit.replace("^", "\\^")}$`), "") : text(low[k]);
    return { distance, words: `${model.descriptors[k].words} ${text(point[k])}; trained on ${lowest} to ${text(high[k])}` };
  }
  k = largest(point.map((value, i) => Math.abs(nearest[i] - value) / deviation[i]));
  return { distance, words: `${model.descriptors[k].words} ${text(point[k])} with all else as it is; the nearest training sample has ${text(nearest[k])}` };
}

function quantity(model: Model, k: number, value: number): string {
  const { name, unit } = model.descriptors[k];
  const box = model.bounds[name as keyof Cells];
  let real = value;
  if (box) real = box.lower + value * (box.upper - box.lower);
  else if (name === "area" || name === "tether_area") real = value ** 2;
  else if (name === "slenderness") real = Math.exp(value);
  else if (name === "tethers") real = Math.round(value ** 2);
  return `${general(real)} ${unit}`.trim();
}

/** A number to three digits, as Python's `.3g` writes it. */
export function general(value: number, digits = 3): string {
  if (value === 0 || !isFinite(value)) return String(value);
  const [mantissa, exponent] = value.toExponential(digits - 1).split("e");
  const power = Number(exponent);
  const trim = (text: string) => (text.includes(".") ? text.replace(/\.?0+$/, "") : text);
  if (power < -4 || power >= digits) return `${trim(mantissa)}e${power < 0 ? "-" : "+"}${String(Math.abs(power)).padStart(2, "0")}`;
  return trim(value.toFixed(Math.max(0, digits - 1 - power)));
}
