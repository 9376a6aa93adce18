// Plane geometry of rings (corners, the first not repeated).
import { union, type Geom } from "polyclip-ts";
import { isCircle, type Circle, type Mould, type Point, type Ring, type Tether } from "./model";

/** Twice the signed area, positive counter-clockwise. */
function doubleArea(ring: Ring): number {
  let sum = 0;
  for (let i = 0, j = ring.length - 1; i < ring.length; j = i++) sum += ring[j][0] * ring[i][1] - ring[i][0] * ring[j][1];
  return sum;
}

export const area = (ring: Ring) => Math.abs(doubleArea(ring)) / 2;

export function centroid(ring: Ring): Point {
  const twice = doubleArea(ring);
  if (Math.abs(twice) < 1e-12) return ring[0];
  let x = 0, y = 0;
  for (let i = 0, j = ring.length - 1; i < ring.length; j = i++) {
    const cross = ring[j][0] * ring[i][1] - ring[i][0] * ring[j][1];
    x += (ring[j][0] + ring[i][0]) * cross;
    y += (ring[j][1] + ring[i][1]) * cross;
  }
  return [x / (3 * twice), y / (3 * twice)];
}

export function bounds(ring: Ring): [number, number, number, number] {
  let x0 = Infinity, y0 = Infinity, x1 = -Infinity, y1 = -Infinity;
  for (const [x, y] of ring) {
    x0 = Math.min(x0, x); x1 = Math.max(x1, x);
    y0 = Math.min(y0, y); y1 = Math.max(y1, y);
  }
  return [x0, y0, x1, y1];
}

export function contains(ring: Ring, x: number, y: number): boolean {
  let inside = false;
  for (let i = 0, j = ring.length - 1; i < ring.length; j = i++) {
    const [xi, yi] = ring[i], [xj, yj] = ring[j];
    if (yi > y !== yj > y && x < ((xj - xi) * (y - yi)) / (yj - yi) + xi) inside = !inside;
  }
  return inside;
}

export function distanceToSegment(x: number, y: number, a: Point, b: Point): number {
  const dx = b[0] - a[0], dy = b[1] - a[1];
  const square = dx * dx + dy * dy;
  const along = square > 0 ? Math.min(1, Math.max(0, ((x - a[0]) * dx + (y - a[1]) * dy) / square)) : 0;
  if (along > 0 && along < 1) return Math.abs((x - a[0]) * dy - (y - a[1]) * dx) / Math.sqrt(square);
  return Math.hypot(x - a[0] - along * dx, y - a[1] - along * dy);
}

export function distanceToRing(ring: Ring, x: number, y: number): number {
  let least = Infinity;
  for (let i = 0, j = ring.length - 1; i < ring.length; j = i++) {
    least = Math.min(least, distanceToSegment(x, y, ring[j], ring[i]));
  }
  return least;
}

/** Distance to a ring's boundary, positive inside. */
export function signedDepth(ring: Ring, x: number, y: number): number {
  const distance = distanceToRing(ring, x, y);
  return contains(ring, x, y) ? distance : -distance;
}

export function tetherDepth(tether: Tether, x: number, y: number): number {
  return isCircle(tether) ? tether.radius - Math.hypot(x - tether.x, y - tether.y) : signedDepth(tether.polygon, x, y);
}

/** A circle as the package draws it, with `segments` corners a quarter. */
export function circleRing(circle: Circle, segments = 64): Ring {
  return Array.from({ length: 4 * segments }, (_, i) => {
    const angle = (-Math.PI / 2) * (i / segments);
    return [circle.x + circle.radius * Math.cos(angle), circle.y + circle.radius * Math.sin(angle)];
  });
}

export const ringOf = (tether: Tether) => (isCircle(tether) ? circleRing(tether) : tether.polygon);

export const centreOf = (tether: Tether): Point =>
  isCircle(tether) ? [tether.x, tether.y] : centroid(tether.polygon);

function convexHull(ring: Ring): Ring {
  const points = [...ring].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (ordered: Ring) => {
    const found: Ring = [];
    for (const p of ordered) {
      while (found.length > 1) {
        const a = found[found.length - 2], b = found[found.length - 1];
        if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0) break;
        found.pop();
      }
      found.push(p);
    }
    return found.slice(0, -1);
  };
  return [...half(points), ...half(points.reverse())];
}

/** Distance of a point from the line through two others, positive on its right. */
const fromLine = (p: Point, a: Point, b: Point) => {
  const dx = b[0] - a[0], dy = b[1] - a[1], square = dx * dx + dy * dy;
  return (((a[1] - p[1]) * dx - (a[0] - p[0]) * dy) / square) * Math.sqrt(square);
};

/**
 * Centre of the rectangle of least area around a ring, and half of its long side.
 *
 * Regular shapes have several; which one is taken is left to rounding, in the order of edges and of operations
 * that GEOS has, so that the same one is taken here as in the package.
 */
export function longAxis(ring: Ring): { centre: Point; half: Point } {
  const hull = convexHull(ring).reverse(); // clockwise, from the lowest corner
  const start = hull.reduce((low, p, i) => (p[1] < hull[low][1] || (p[1] === hull[low][1] && p[0] < hull[low][0]) ? i : low), 0);
  const corners = [...hull.slice(start), ...hull.slice(0, start)];
  let best = Infinity, sides: Point[] = [], centre: Point = [0, 0];
  corners.forEach((a, i) => {
    const b = corners[(i + 1) % corners.length], dx = b[0] - a[0], dy = b[1] - a[1], square = dx * dx + dy * dy;
    const top = corners.reduce((far, p) => (Math.abs(fromLine(p, a, b)) > Math.abs(fromLine(far, a, b)) ? p : far));
    const along = ((top[0] - a[0]) * dx + (top[1] - a[1]) * dy) / square, foot: Point = [a[0] + along * dx, a[1] + along * dy];
    const across = corners.map((p) => fromLine(p, foot, top)), most = Math.max(...across), least = Math.min(...across);
    const height = Math.hypot(top[0] - foot[0], top[1] - foot[1]), size = height * (Math.abs(most) + Math.abs(least));
    if (size >= best) return;
    best = size;
    const u: Point = [dx / Math.sqrt(square), dy / Math.sqrt(square)], v: Point = [(top[0] - foot[0]) / height, (top[1] - foot[1]) / height];
    const places = corners.map((p) => (p[0] - foot[0]) * u[0] + (p[1] - foot[1]) * u[1]), s0 = Math.min(...places), s1 = Math.max(...places);
    sides = [[u[0] * (s1 - s0), u[1] * (s1 - s0)], [top[0] - foot[0], top[1] - foot[1]]];
    const s = (s0 + s1) / 2;
    centre = [foot[0] + s * u[0] + (height / 2) * v[0], foot[1] + s * u[1] + (height / 2) * v[1]];
  });
  const [first, second] = sides, lengths = [Math.hypot(...first), Math.hypot(...second)];
  const equal = Math.abs(lengths[0] - lengths[1]) <= 1e-8 + 1e-6 * lengths[1];
  const long = equal ? Math.abs(second[0]) > Math.abs(first[0]) : lengths[1] > lengths[0];
  const side = long ? second : first;
  return { centre, half: [side[0] / 2, side[1] / 2] };
}

/** Whether no circle of a radius fits into a region given by its rings (outer, then holes), to a precision. */
export function isNarrower(rings: Ring[], radius: number, precision = 1e-3): boolean {
  const depth = (x: number, y: number) => {
    let inside = false, least = Infinity;
    for (const ring of rings) {
      if (contains(ring, x, y)) inside = !inside;
      least = Math.min(least, distanceToRing(ring, x, y));
    }
    return inside ? least : -least;
  };
  const [x0, y0, x1, y1] = bounds(rings[0]);
  const side = Math.min(x1 - x0, y1 - y0);
  if (side < 2 * radius) return true;
  let best = 0;
  type Cell = { x: number; y: number; half: number; most: number };
  const cell = (x: number, y: number, half: number): Cell => {
    const found = depth(x, y);
    best = Math.max(best, found);
    return { x, y, half, most: found + half * Math.SQRT2 };
  };
  let cells: Cell[] = [];
  for (let x = x0 + side / 2; x < x1 + side / 2; x += side) {
    for (let y = y0 + side / 2; y < y1 + side / 2; y += side) cells.push(cell(x, y, side / 2));
  }
  while (cells.length && best < radius) {
    cells = cells
      .filter((each) => each.most > radius + precision)
      .flatMap(({ x, y, half }) =>
        [[-1, -1], [-1, 1], [1, -1], [1, 1]].map(([i, j]) => cell(x + (i * half) / 2, y + (j * half) / 2, half / 2)));
  }
  return best < radius;
}

const crosses = (a: Point, b: Point, c: Point, d: Point) => {
  const side = (p: Point, q: Point, r: Point) => (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
  const on = (p: Point, q: Point, r: Point) =>
    Math.min(p[0], q[0]) <= r[0] && r[0] <= Math.max(p[0], q[0]) && Math.min(p[1], q[1]) <= r[1] && r[1] <= Math.max(p[1], q[1]);
  const [s, t, u, v] = [side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b)];
  if (s * t < 0 && u * v < 0) return true;
  return (s === 0 && on(a, b, c)) || (t === 0 && on(a, b, d)) || (u === 0 && on(c, d, a)) || (v === 0 && on(c, d, b));
};

/** Whether no two edges of a ring cross or touch, except neighbours at their corner. */
export function isSimple(ring: Ring): boolean {
  const n = ring.length;
  for (let i = 0; i < n; i++) {
    for (let j = i + 2; j < n; j++) {
      if (i === 0 && j === n - 1) continue;
      if (crosses(ring[i], ring[i + 1], ring[j], ring[(j + 1) % n])) return false;
    }
    const a = ring[i], b = ring[(i + 1) % n], c = ring[(i + 2) % n];
    const turn = (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]);
    const back = (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]);
    if (turn === 0 && back < 0) return false;
  }
  return true;
}

const meet = (a: Tether, b: Tether) => {
  const p = ringOf(a), q = ringOf(b);
  const s = bounds(p), t = bounds(q);
  if (s[0] > t[2] || t[0] > s[2] || s[1] > t[3] || t[1] > s[3]) return false;
  if (contains(p, ...q[0]) || contains(q, ...p[0])) return true;
  return p.some((corner, i) => q.some((other, j) => crosses(corner, p[(i + 1) % p.length], other, q[(j + 1) % q.length])));
};

/** Tethers in groups that overlap: indices, and the rings of each group's union. */
export function joinedTethers(mould: Mould): { members: number[]; rings: Ring[] }[] {
  const rest = new Set(mould.tethers.keys());
  const groups: { members: number[]; rings: Ring[] }[] = [];
  for (const start of mould.tethers.keys()) {
    if (!rest.delete(start)) continue;
    const members = [start];
    for (const one of members) {
      for (const other of rest) {
        if (meet(mould.tethers[one], mould.tethers[other])) { members.push(other); rest.delete(other); }
      }
    }
    const rings = members.map((i) => ringOf(mould.tethers[i]));
    if (members.length === 1) { groups.push({ members, rings }); continue; }
    for (const polygon of union([rings[0]] as Geom, ...rings.slice(1).map((ring) => [ring] as Geom))) {
      groups.push({ members, rings: polygon.map((ring) => ring.slice(0, -1)) });
    }
  }
  return groups;
}

/** What is wrong with a mould, in one sentence; empty if it can be cast. */
export function fault(mould: Mould, constants: Record<string, number>): string {
  const half = constants.IMAGE_SIZE / 2;
  const [x0, y0, x1, y1] = bounds(mould.outline);
  if (!isSimple(mould.outline)) return "Edges of the outline cross: move a corner back.";
  if (mould.outline.length < 3 || area(mould.outline) < 1e-9) return "The outline encloses no area: give it three corners or more.";
  if (Math.max(-x0, -y0, x1, y1) > half + 1e-9) return `The outline leaves the frame of ${constants.IMAGE_SIZE} l\u2080: make it smaller.`;
  for (const [index, tether] of mould.tethers.entries()) {
    const words = `${isCircle(tether) ? "Post" : "Bar"} ${index + 1}`;
    if (!isCircle(tether) && (tether.polygon.length < 3 || !isSimple(tether.polygon))) return `${words} has edges that cross: move a corner back.`;
    const least = 0.999 * constants.SMALLEST_TETHER;
    if (isCircle(tether) ? tether.radius < least : isNarrower([tether.polygon], least)) return `${words} is too thin to hold cells back: make it ${2 * constants.SMALLEST_TETHER} l\u2080 across or more.`;
    if (!standsIn(tether, mould.outline, constants.TOUCHING)) return `${words} reaches out of the outline: move it inside.`;
  }
  return "";
}

function standsIn(tether: Tether, outline: Ring, touching: number): boolean {
  if (isCircle(tether)) {
    return signedDepth(outline, tether.x, tether.y) >= tether.radius - touching;
  }
  const ring = tether.polygon;
  if (ring.some(([x, y]) => signedDepth(outline, x, y) < -touching)) return false;
  return outline.every(([x, y]) => signedDepth(ring, x, y) <= touching)
    && ring.every((a, i) => {
      const b = ring[(i + 1) % ring.length];
      return signedDepth(outline, (a[0] + b[0]) / 2, (a[1] + b[1]) / 2) >= -touching;
    });
}
