// A/A0, w/w0 and held tethers from a density: the twin of raptor.fields.shape and raptor.fields.tethers.
import { outside } from "./images";
import { pixelSize, type Model } from "./model";
import type { Cast } from "./cast";

type Image = ArrayLike<number>;

function free(density: Image, level: number, pixels: number): Uint8Array {
  const open = new Uint8Array(density.length);
  for (let p = 0; p < open.length; p++) open[p] = density[p] > level ? 0 : 1;
  return outside(open, pixels);
}

/** Whether a tether has a pixel that is open. */
function reached(depth: Float32Array, open: Uint8Array): boolean {
  for (let p = 0; p < depth.length; p++) if (depth[p] >= 0 && open[p]) return true;
  return false;
}

/** A/A0 and w/w0 of a predicted density. */
export function ratios(density: Image, cast: Cast, model: Model, threshold = model.threshold): [number, number] {
  const tissue = filled(density, cast, threshold, model);
  const before = asCast(cast, model);
  const area = areaAbove(tissue, model.pixels), length = lengthAbove(tissue, cast, model);
  return [
    before.area > 0 ? area / before.area : NaN,
    Math.min(length, before.length) > 0 ? length / before.length : NaN,
  ];
}

const known = new WeakMap<Cast, { area: number; length: number }>();

function asCast(cast: Cast, model: Model) {
  let found = known.get(cast);
  if (!found) {
    const before = filled(cast.density, cast, model.cast_threshold, model);
    found = { area: areaAbove(before, model.pixels), length: lengthAbove(before, cast, model) };
    known.set(cast, found);
  }
  return found;
}

/** Density minus the threshold, made positive in thin tethers enclosed by tissue. */
export function filled(density: Image, cast: Cast, threshold: number, model: Model): Float64Array {
  const { ENCLOSING, CLEARANCE, GAP } = model.constants;
  const above = new Float64Array(density.length);
  for (let p = 0; p < above.length; p++) above[p] = density[p] - threshold;
  if (!cast.thin.length) return above;
  const enclosing = free(density, ENCLOSING * threshold, model.pixels), open = free(density, threshold, model.pixels);
  for (const depth of cast.thin) {
    if (reached(depth, enclosing)) continue;
    for (let p = 0; p < above.length; p++) {
      if (depth[p] > -1) above[p] = Math.max(above[p], threshold * (depth[p] + (open[p] ? CLEARANCE : GAP)));
    }
  }
  return above;
}

/** Area, in pixels, where values at pixel centres are positive, linear over four triangles a square. */
export function areaAbove(values: Image, pixels: number): number {
  let total = 0;
  for (let y = -1; y < pixels; y++) {
    const low = Math.max(0, y) * pixels, high = Math.min(pixels - 1, y + 1) * pixels;
    for (let x = -1; x < pixels; x++) {
      const left = Math.max(0, x), right = Math.min(pixels - 1, x + 1);
      const a = values[low + left], b = values[low + right], c = values[high + right], d = values[high + left];
      if (a <= 0 && b <= 0 && c <= 0 && d <= 0) continue;
      let share = 1;
      if (!(a > 0 && b > 0 && c > 0 && d > 0)) {
        const middle = (a + b + c + d) / 4;
        share = (positivePart(a, d, middle) + positivePart(b, a, middle) + positivePart(c, b, middle) + positivePart(d, c, middle)) / 4;
      }
      if (y === -1 || y === pixels - 1) share /= 2;
      if (x === -1 || x === pixels - 1) share /= 2;
      total += share;
    }
  }
  return total;
}

function positivePart(a: number, b: number, c: number): number {
  const low = Math.min(a, b, c), high = Math.max(a, b, c), middle = a + b + c - low - high;
  if (low > 0) return 1;
  if (middle > 0) return 1 - low ** 2 / ((middle - low) * (high - low));
  return high > 0 ? high ** 2 / ((high - middle) * (high - low)) : 0;
}

/** Length on the central section, l0, where an image is positive. */
function lengthAbove(above: Image, cast: Cast, model: Model): number {
  const pixels = model.pixels, step = pixelSize(model) / model.constants.SAMPLES_PER_PIXEL;
  const size = Math.hypot(...cast.half), across = [-cast.half[1] / size, cast.half[0] / size];
  const count = Math.floor(model.constants.IMAGE_SIZE / step);
  const middle = (pixels - 1) / 2;
  const sample = (k: number) => {
    const x = middle + (cast.centre[0] + k * step * across[0]) / pixelSize(model);
    const y = middle + (cast.centre[1] + k * step * across[1]) / pixelSize(model);
    if (x < 0 || y < 0 || x > pixels - 1 || y > pixels - 1) return -1;
    const i = Math.min(pixels - 2, Math.floor(x)), j = Math.min(pixels - 2, Math.floor(y)), s = x - i, t = y - j;
    const p = j * pixels + i;
    return (above[p] * (1 - s) + above[p + 1] * s) * (1 - t) + (above[p + pixels] * (1 - s) + above[p + pixels + 1] * s) * t;
  };
  let total = 0, left = sample(-count);
  for (let k = 1 - count; k <= count; k++) {
    const right = sample(k);
    if (left > 0 && right > 0) total += 1;
    else if (left > 0 || right > 0) total += Math.max(left, right) / Math.abs(left - right);
    left = right;
  }
  return total * step;
}

/** Whether tissue encloses each tether: 1 or 0; NaN if it does not as cast. */
export function held(density: Image, cast: Cast, model: Model, threshold = model.threshold): number[] {
  const now = free(density, model.constants.OPEN * threshold, model.pixels);
  const before = free(cast.density, model.constants.CLOSED * model.cast_threshold, model.pixels);
  return cast.depths.map((depth) => (reached(depth, before) ? NaN : reached(depth, now) ? 0 : 1));
}
