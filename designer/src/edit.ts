// Edits of a mould, each a pure function; with a symmetry, the images of what is edited follow.
import { intersection, union, type Geom } from "polyclip-ts";
import { bounds, centreOf, contains, distanceToRing, tetherDepth } from "./geometry";
import { isCircle, type Mould, type Point, type Ring, type Tether } from "./model";

export type Symmetry = "none" | "x" | "y" | "both" | "turn";
type Image = (p: Point) => Point;

const MIRROR_X: Image = ([x, y]) => [-x, y];
const MIRROR_Y: Image = ([x, y]) => [x, -y];
const TURN: Image = ([x, y]) => [-x, -y];
const IMAGES: Record<Symmetry, Image[]> = { none: [], x: [MIRROR_X], y: [MIRROR_Y], both: [MIRROR_X, MIRROR_Y, TURN], turn: [TURN] };

export const rounded = (value: number, step = 1e-4) => Math.round(Math.round(value / step) * step * 1e6) / 1e6 + 0;
const near = (a: Point, b: Point, reach = 0.02) => Math.hypot(a[0] - b[0], a[1] - b[1]) < reach;
const middle = (a: Point, b: Point): Point => [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];

/** A point held where a symmetry holds what it moves: on the axis, if it was there. */
function constrained(to: Point, from: Point, symmetry: Symmetry): Point {
  return IMAGES[symmetry].reduce((p, image) => (near(image(from), from) ? middle(p, image(p)) : p), to);
}

export function moveCorner(mould: Mould, index: number, to: Point, symmetry: Symmetry): Mould {
  const outline = mould.outline.slice(), from = mould.outline[index], at = constrained(to, from, symmetry);
  for (const image of IMAGES[symmetry]) {
    const partner = mould.outline.findIndex((corner) => near(corner, image(from)));
    if (partner >= 0) outline[partner] = image(at);
  }
  outline[index] = at;
  return { ...mould, outline };
}

export function moveEdge(mould: Mould, index: number, by: Point, symmetry: Symmetry): Mould {
  const next = (index + 1) % mould.outline.length, a = mould.outline[index], b = mould.outline[next];
  let shift = by;
  for (const image of IMAGES[symmetry]) {
    if (near(image(a), b) && near(image(b), a)) {
      const [x0, y0] = image([0, 0]), [x, y] = image(shift);
      shift = middle(shift, [x - x0, y - y0]);
    }
  }
  const outline = mould.outline.slice();
  for (const [corner, from] of [[index, a], [next, b]] as [number, Point][]) {
    const to = constrained([from[0] + shift[0], from[1] + shift[1]], from, symmetry);
    for (const image of IMAGES[symmetry]) {
      const partner = mould.outline.findIndex((other) => near(other, image(from)));
      if (partner >= 0 && partner !== index && partner !== next) outline[partner] = image(to);
    }
    outline[corner] = to;
  }
  return { ...mould, outline };
}

/** A new corner on an edge, and where it stands in the outline. */
export function addCorner(mould: Mould, index: number, at: Point, symmetry: Symmetry): { mould: Mould; index: number } {
  const n = mould.outline.length, added: Point[][] = mould.outline.map(() => []);
  added[index].push(at);
  const a = mould.outline[index], b = mould.outline[(index + 1) % n];
  for (const image of IMAGES[symmetry]) {
    const edge = mould.outline.findIndex((corner, i) => {
      const ends = [corner, mould.outline[(i + 1) % n]];
      return (near(ends[0], image(a)) && near(ends[1], image(b))) || (near(ends[1], image(a)) && near(ends[0], image(b)));
    });
    if (edge >= 0 && !added[edge].some((p) => near(p, image(at), 0.3))) added[edge].push(image(at));
  }
  const outline = mould.outline.flatMap((corner, i) =>
    [corner, ...added[i].sort((p, q) => Math.hypot(p[0] - corner[0], p[1] - corner[1]) - Math.hypot(q[0] - corner[0], q[1] - corner[1]))]);
  return { mould: { ...mould, outline }, index: outline.findIndex((p) => p === at) };
}

export function removeCorner(mould: Mould, index: number, symmetry: Symmetry): Mould {
  const from = mould.outline[index], gone = new Set([index]);
  for (const image of IMAGES[symmetry]) {
    const partner = mould.outline.findIndex((corner) => near(corner, image(from)));
    if (partner >= 0) gone.add(partner);
  }
  const outline = mould.outline.filter((_, i) => !gone.has(i));
  return outline.length >= 3 ? { ...mould, outline } : mould;
}

const imageOf = (tether: Tether, image: Image): Tether => {
  if (!isCircle(tether)) return { polygon: tether.polygon.map(image).reverse() };
  const [x, y] = image([tether.x, tether.y]);
  return { x, y, radius: tether.radius };
};

export function shifted(tether: Tether, by: Point): Tether {
  if (isCircle(tether)) return { ...tether, x: rounded(tether.x + by[0]), y: rounded(tether.y + by[1]) };
  return { polygon: tether.polygon.map(([x, y]) => [rounded(x + by[0]), rounded(y + by[1])]) };
}

const partners = (mould: Mould, index: number, image: Image) => {
  const old = mould.tethers[index], to = image(centreOf(old));
  return mould.tethers.findIndex((other) => isCircle(other) === isCircle(old) && near(centreOf(other), to, 0.05));
};

/** Replaces a tether, or removes it, and its images with it. */
export function withTether(mould: Mould, index: number, next: Tether | null, symmetry: Symmetry): Mould {
  const tethers: (Tether | null)[] = mould.tethers.slice();
  let placed = next;
  if (placed) {
    const from = centreOf(mould.tethers[index]), to = centreOf(placed), held = constrained(to, from, symmetry);
    placed = shifted(placed, [held[0] - to[0], held[1] - to[1]]);
  }
  for (const image of IMAGES[symmetry]) {
    const partner = partners(mould, index, image);
    if (partner >= 0 && partner !== index) tethers[partner] = placed && imageOf(placed, image);
  }
  tethers[index] = placed;
  return { ...mould, tethers: tethers.filter((each) => each !== null) };
}

/** Whether a symmetry maps a tether onto its own place. */
export const isOnAxis = (mould: Mould, index: number, symmetry: Symmetry) =>
  symmetry !== "turn" && IMAGES[symmetry].some((image) => partners(mould, index, image) === index);

export function addTether(mould: Mould, tether: Tether, symmetry: Symmetry): Mould {
  const tethers = [...mould.tethers, tether];
  for (const image of IMAGES[symmetry]) {
    const other = imageOf(tether, image);
    if (!tethers.some((each) => near(centreOf(each), centreOf(other), 0.5))) tethers.push(other);
  }
  return { ...mould, tethers };
}

/** The point of the depression that is farthest from all walls. */
export function freePlace(mould: Mould): Point {
  const [x0, y0, x1, y1] = bounds(mould.outline);
  let best: Point = [0, 0], most = -Infinity;
  for (let i = 1; i < 40; i++) {
    for (let j = 1; j < 40; j++) {
      const x = x0 + ((x1 - x0) * i) / 40, y = y0 + ((y1 - y0) * j) / 40;
      if (!contains(mould.outline, x, y)) continue;
      const room = Math.min(distanceToRing(mould.outline, x, y), ...mould.tethers.map((tether) => -tetherDepth(tether, x, y)));
      if (room > most + 1e-6) { most = room; best = [rounded(x, 0.1), rounded(y, 0.1)]; }
    }
  }
  return best;
}

export interface Rectangle { x: number; y: number; length: number; width: number; angle: number }

/** A polygon as a rectangle, its long side first; null if it is none. */
export function asRectangle(ring: Ring): Rectangle | null {
  if (ring.length !== 4) return null;
  const [a, b, c, d] = ring, [x, y] = middle(a, c);
  if (!near(middle(a, c), middle(b, d), 1e-2)) return null;
  const u: Point = [b[0] - a[0], b[1] - a[1]], v: Point = [c[0] - b[0], c[1] - b[1]];
  const [p, q] = [Math.hypot(...u), Math.hypot(...v)];
  if (Math.abs(u[0] * v[0] + u[1] * v[1]) > 1e-2 * p * q) return null;
  const [long, length, width] = p >= q ? [u, p, q] : [v, q, p];
  let angle = Math.atan2(long[1], long[0]);
  if (angle <= -Math.PI / 2 + 1e-9) angle += Math.PI;
  if (angle > Math.PI / 2 + 1e-9) angle -= Math.PI;
  return { x, y, length, width, angle };
}

export function rectangleRing({ x, y, length, width, angle }: Rectangle): Ring {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return ([[-1, -1], [1, -1], [1, 1], [-1, 1]] as Point[]).map(([i, j]) => {
    const [u, v] = [(i * length) / 2, (j * width) / 2];
    return [rounded(x + u * c - v * s), rounded(y + u * s + v * c)];
  });
}

export function scaledTether(tether: Tether, factor: number): Tether {
  if (isCircle(tether)) return { ...tether, radius: rounded(tether.radius * factor) };
  const [x, y] = centreOf(tether);
  return { polygon: tether.polygon.map(([u, v]) => [rounded(x + (u - x) * factor), rounded(y + (v - y) * factor)]) };
}

/** A mould made symmetric: near partners meet half way; where there are none, one part is repeated. */
export function symmetrised(mould: Mould, symmetry: Symmetry): Mould {
  const images = IMAGES[symmetry];
  if (!images.length) return mould;
  return { outline: symmetricOutline(mould.outline, symmetry), tethers: symmetricTethers(mould.tethers, images, symmetry) };
}

function symmetricOutline(outline: Ring, symmetry: Symmetry): Ring {
  const images = IMAGES[symmetry];
  const matched = outline.map((corner) => images.map((image) => outline.find((other) => near(other, image(corner), 0.3))));
  if (matched.every((found) => found.every(Boolean))) {
    return outline.map((corner, k) => {
      const all = [corner, ...matched[k].map((other, g) => images[g](other!))];
      return [0, 1].map((axis) => rounded(all.reduce((sum, p) => sum + p[axis], 0) / all.length)) as Point;
    });
  }
  const far = 100, right = symmetry === "y" ? -far : 0, low = symmetry === "y" || symmetry === "both" ? 0 : -far;
  const part = intersection([outline] as Geom, [[[right, low], [far, low], [far, far], [right, far]]] as Geom);
  if (!part.length) return outline;
  const copies = images.map((image) => part.map((polygon) => polygon.map((ring) => ring.map((p) => image(p as Point)))));
  const joined = union(part as Geom, ...(copies as Geom[]));
  const largest = joined.map((polygon) => polygon[0].slice(0, -1) as Ring).sort((a, b) => b.length - a.length)[0];
  return largest.map(([x, y]) => [rounded(x), rounded(y)] as Point);
}

function symmetricTethers(tethers: Tether[], images: Image[], symmetry: Symmetry): Tether[] {
  const found: Tether[] = [];
  for (const tether of tethers) {
    let [x, y] = centreOf(tether);
    const mirrorsX = symmetry === "x" || symmetry === "both", mirrorsY = symmetry === "y" || symmetry === "both";
    const by: Point = [mirrorsX && Math.abs(x) < 0.5 ? -x : 0, mirrorsY && Math.abs(y) < 0.5 ? -y : 0];
    [x, y] = [x + by[0], y + by[1]];
    if ((mirrorsX && x < 0) || (mirrorsY && y < 0) || (symmetry === "turn" && x < -1e-6)) continue;
    const own = shifted(tether, by);
    for (const each of [own, ...images.map((image) => imageOf(own, image))]) {
      if (!found.some((other) => near(centreOf(other), centreOf(each), 0.5))) found.push(each);
    }
  }
  return found.length ? found : tethers;
}
