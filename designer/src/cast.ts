// A mould cast with layers of cells and imaged: the twin of raptor.moulds.cast and raptor.moulds.raster.
import * as geometry from "./geometry";
import { pixelCentres, pixelSize, type Model, type Mould, type Point } from "./model";

export interface Cast {
  mould: Mould;
  depression: Uint8Array; // (y, x)
  tethers: Uint8Array;
  cells: number;
  density: Float64Array; // as cast, per pixel
  depths: Float32Array[]; // of pixel centres in each tether, l0
  thin: Float32Array[]; // the same of each thin tether
  centre: Point;
  half: Point; // of the long side
}

export class Fault extends Error {}

export function cast(mould: Mould, model: Model): Cast {
  const depths = mould.tethers.map((_, i) => tetherDepths(mould, i, model));
  const { depression, tethers } = masks(mould, depths, model);
  const planes = [0, 0.5].slice(0, Math.min(model.layers, 2)).map((shift) => plane(mould, shift, model));
  const inPlane = planes.map((sites) => sites.reduce((sum, each) => sum + each, 0));
  const layers = planes.map((_, parity) => Math.ceil((model.layers - parity) / 2));
  const cells = layers.reduce((sum, count, parity) => sum + count * inPlane[parity], 0);
  if (!cells) throw new Fault("The mould holds no cell: draw it larger.");
  const density = new Float64Array(model.pixels ** 2);
  planes.forEach((sites, parity) => addDensity(density, sites, parity / 2, layers[parity], model));
  return { mould, depression, tethers, cells, density, depths, thin: thinDepths(mould, depths, model), ...geometry.longAxis(mould.outline) };
}

function tetherDepths(mould: Mould, index: number, model: Model): Float32Array {
  const tether = mould.tethers[index], centres = pixelCentres(model), pixels = model.pixels;
  const [x0, y0, x1, y1] = geometry.bounds(geometry.ringOf(tether));
  const depth = new Float32Array(pixels ** 2).fill(-Infinity);
  for (let y = 0; y < pixels; y++) {
    if (centres[y] < y0 - 1 || centres[y] > y1 + 1) continue;
    for (let x = 0; x < pixels; x++) {
      if (centres[x] < x0 - 1 || centres[x] > x1 + 1) continue;
      const found = geometry.tetherDepth(tether, centres[x], centres[y]);
      depth[y * pixels + x] = Math.abs(found) <= model.constants.STRICTLY ? 0 : found;
    }
  }
  return depth;
}

function masks(mould: Mould, depths: Float32Array[], model: Model) {
  const pixels = model.pixels, depression = strictlyInside(mould, model), tethers = new Uint8Array(pixels ** 2);
  for (let p = 0; p < depression.length; p++) {
    if (depression[p] && depths.some((depth) => depth[p] >= 0)) { tethers[p] = 1; depression[p] = 0; }
  }
  if (!depression.includes(1)) throw new Fault("The mould covers no pixel: draw it larger.");
  return { depression, tethers };
}

/** Pixels whose centres lie inside the outline, not on it. */
function strictlyInside(mould: Mould, model: Model): Uint8Array {
  const ring = mould.outline, centres = pixelCentres(model), pixels = model.pixels;
  const inside = new Uint8Array(pixels ** 2);
  for (let y = 0; y < pixels; y++) {
    const crossings: number[] = [];
    for (let i = 0, j = ring.length - 1; i < ring.length; j = i++) {
      const [xi, yi] = ring[i], [xj, yj] = ring[j];
      if (yi > centres[y] !== yj > centres[y]) crossings.push(((xj - xi) * (centres[y] - yi)) / (yj - yi) + xi);
    }
    crossings.sort((a, b) => a - b);
    for (let k = 0; k + 1 < crossings.length; k += 2) {
      for (let x = 0; x < pixels; x++) if (centres[x] > crossings[k] && centres[x] < crossings[k + 1]) inside[y * pixels + x] = 1;
    }
  }
  const exact = inside.slice();
  for (let y = 0; y < pixels; y++) {
    for (let x = 0; x < pixels; x++) {
      const p = y * pixels + x;
      let same = true;
      for (let j = Math.max(0, y - 1); j <= Math.min(pixels - 1, y + 1) && same; j++) {
        for (let i = Math.max(0, x - 1); i <= Math.min(pixels - 1, x + 1); i++) if (inside[j * pixels + i] !== inside[p]) same = false;
      }
      if (!same) exact[p] = geometry.signedDepth(ring, centres[x], centres[y]) > model.constants.STRICTLY ? 1 : 0;
    }
  }
  return exact;
}

const span = (model: Model) => Math.ceil(model.constants.IMAGE_SIZE / 2);

/** Sites of one layer, 1 where a cell is, on the square lattice (2 span + 1 per side) moved by a shift. */
function plane(mould: Mould, shift: number, model: Model): Uint8Array {
  const half = span(model), side = 2 * half + 1, sites = new Uint8Array(side * side);
  const [x0, y0, x1, y1] = geometry.bounds(mould.outline);
  for (let j = 0; j < side; j++) {
    const y = j - half + shift;
    if (y < y0 || y > y1) continue;
    for (let i = 0; i < side; i++) {
      const x = i - half + shift;
      if (x < x0 || x > x1) continue;
      let depth = -geometry.signedDepth(mould.outline, x, y);
      for (const tether of mould.tethers) depth = Math.max(depth, geometry.tetherDepth(tether, x, y));
      if (depth <= -model.clearance) sites[j * side + i] = 1;
    }
  }
  return sites;
}

/** Error function, to rounding: a series near zero, a continued fraction beyond. */
export function erf(x: number): number {
  const size = Math.abs(x);
  if (size > 6) return Math.sign(x);
  if (size < 2.5) {
    let term = x, sum = x;
    for (let n = 1; Math.abs(term) > 1e-17 * Math.abs(sum); n++) {
      term *= (-x * x) / n;
      sum += term / (2 * n + 1);
      if (n > 200) break;
    }
    return (2 / Math.sqrt(Math.PI)) * sum;
  }
  let fraction = 0;
  for (let k = 80; k > 0; k--) fraction = k / 2 / (size + fraction);
  return Math.sign(x) * (1 - Math.exp(-size * size) / (Math.sqrt(Math.PI) * (size + fraction)));
}

/** Integrals over pixels of a Gaussian at each place of a lattice axis: (place, pixel). */
function gaussians(shift: number, model: Model): Float64Array[] {
  const { IMAGE_SIZE, SIGMA } = model.constants, size = pixelSize(model), half = span(model);
  return Array.from({ length: 2 * half + 1 }, (_, i) => {
    const edges = Array.from({ length: model.pixels + 1 }, (_, k) =>
      erf((-IMAGE_SIZE / 2 + k * size - (i - half + shift)) / (SIGMA * Math.SQRT2)));
    return Float64Array.from({ length: model.pixels }, (_, k) => (edges[k + 1] - edges[k]) / 2);
  });
}

const tables = new Map<string, Float64Array[]>();

function addDensity(density: Float64Array, sites: Uint8Array, shift: number, layers: number, model: Model) {
  const key = `${shift} ${model.pixels}`, pixels = model.pixels, side = 2 * span(model) + 1;
  if (!tables.has(key)) tables.set(key, gaussians(shift, model));
  const weights = tables.get(key)!;
  const reach = Math.ceil((model.constants.REACH * model.constants.SIGMA) / pixelSize(model)) + 1;
  const row = new Float64Array(pixels);
  for (let j = 0; j < side; j++) {
    row.fill(0);
    let any = false;
    for (let i = 0; i < side; i++) {
      if (!sites[j * side + i]) continue;
      any = true;
      const [first, last] = around(i, shift, reach, model);
      for (let x = first; x <= last; x++) row[x] += weights[i][x];
    }
    if (!any) continue;
    const [first, last] = around(j, shift, reach, model);
    for (let y = first; y <= last; y++) {
      const weight = layers * weights[j][y], start = y * pixels;
      for (let x = 0; x < pixels; x++) density[start + x] += weight * row[x];
    }
  }
}

function around(place: number, shift: number, reach: number, model: Model): [number, number] {
  const middle = Math.floor((place - span(model) + shift + model.constants.IMAGE_SIZE / 2) / pixelSize(model));
  return [Math.max(0, middle - reach), Math.min(model.pixels - 1, middle + reach)];
}

/** Depths in each tether, or group of tethers that overlap, narrower than `THIN`. */
function thinDepths(mould: Mould, depths: Float32Array[], model: Model): Float32Array[] {
  const limit = (0.999 * model.constants.THIN) / 2;
  return geometry.joinedTethers(mould)
    .filter(({ rings }) => geometry.isNarrower(rings, limit))
    .map(({ members }) => depths[members[0]].map((depth, p) => Math.max(depth, ...members.slice(1).map((i) => depths[i][p]))));
}
