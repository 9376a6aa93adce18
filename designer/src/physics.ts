// Physical constraints on predicted fields: the twin of raptor.surrogate.constraints.
import { within } from "./images";
import { pixelSize, type Model } from "./model";

const [XX, YY, ZZ, XY, XZ, YZ] = [2, 3, 4, 5, 6, 7];
const SMALL = 1e-12, ROUNDING = 1e-5;

/** Where density may be: within 5 sigma, and a pixel, of the depression. */
export const reachable = (depression: Uint8Array, model: Model) =>
  within(depression, model.pixels, (model.constants.DEEP + pixelSize(model)) / pixelSize(model));

/** Signs for means of magnitudes (in place): sxsz positive, sysz with the sign of sxsy, shortened if need be. */
export function withSign(fields: Float32Array, size: number): Float32Array {
  for (let p = 0; p < size; p++) {
    const x = Math.max(0, fields[XZ * size + p]);
    let y = Math.max(0, fields[YZ * size + p]);
    const a = fields[XX * size + p], b = fields[XY * size + p], c = fields[YY * size + p];
    if (b < 0) y = -y;
    const room = Math.max(0, fields[ZZ * size + p]) * (Math.max(0, a * c - b * b) + ROUNDING * Math.abs(a * c));
    const taken = c * x * x - 2 * b * x * y + a * y * y;
    const short = taken > room ? Math.sqrt(room / Math.max(taken, SMALL)) : 1;
    fields[XZ * size + p] = x * short;
    fields[YZ * size + p] = y * short;
  }
  return fields;
}

/** Density that is not negative, nor out of reach, and sums to the cells (in place, the first `size` values). */
export function projectDensity(fields: Float32Array, there: Uint8Array, cells: number): void {
  let sum = 0;
  for (let p = 0; p < there.length; p++) {
    fields[p] = there[p] ? Math.max(0, fields[p]) : 0;
    sum += fields[p];
  }
  const factor = cells / (sum + SMALL);
  for (let p = 0; p < there.length; p++) fields[p] *= factor;
}

/** Eight fields projected onto the constraints (in place); `trace`: see TRACE in raptor.surrogate.constraints. */
export function project(fields: Float32Array, there: Uint8Array, cells: number, trace: number): Float32Array {
  const size = there.length, least = (trace * cells) / there.reduce((sum, each) => sum + each, 0);
  projectDensity(fields, there, cells);
  const t = new Float64Array(6);
  for (let p = 0; p < size; p++) {
    const wanted = fields[p];
    if (!(wanted > least)) fields[size + p] = 0;
    if (!(wanted > 0)) {
      for (let channel = XX; channel <= YZ; channel++) fields[channel * size + p] = 0;
      continue;
    }
    for (let k = 0; k < 6; k++) t[k] = fields[(XX + k) * size + p];
    const sum = t[0] + t[1] + t[2];
    if (sum > SMALL && isPositive(t)) {
      for (let k = 0; k < 6; k++) t[k] *= wanted / sum;
    } else mend(t, wanted);
    for (let k = 0; k < 6; k++) fields[(XX + k) * size + p] = t[k];
  }
  return fields;
}

/** By principal minors; tensors as xx, yy, zz, xy, xz, yz. */
function isPositive([xx, yy, zz, xy, xz, yz]: Float64Array): boolean {
  const minor = yy * zz - yz * yz;
  return xx >= 0 && yy >= 0 && zz >= 0 && xx * yy - xy * xy >= 0 && xx * zz - xz * xz >= 0 && minor >= 0
    && xx * minor - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz) >= 0;
}

const A = new Float64Array(9), V = new Float64Array(9);

/** Sets negative eigenvalues to zero and scales to a trace (in place): cyclic Jacobi rotations. */
function mend(t: Float64Array, trace: number): void {
  let size = SMALL;
  for (let k = 0; k < 6; k++) size = Math.max(size, Math.abs(t[k]));
  A[0] = t[0] / size; A[4] = t[1] / size; A[8] = t[2] / size;
  A[1] = A[3] = t[3] / size; A[2] = A[6] = t[4] / size; A[5] = A[7] = t[5] / size;
  V.fill(0);
  V[0] = V[4] = V[8] = 1;
  for (let sweep = 0; sweep < 12; sweep++) {
    if (Math.abs(A[1]) + Math.abs(A[2]) + Math.abs(A[5]) < 1e-14) break;
    rotate(0, 1); rotate(0, 2); rotate(1, 2);
  }
  const a = Math.max(0, A[0]) + SMALL, b = Math.max(0, A[4]) + SMALL, c = Math.max(0, A[8]) + SMALL;
  const factor = trace / (a + b + c);
  const entry = (i: number, j: number) =>
    factor * (a * V[3 * i] * V[3 * j] + b * V[3 * i + 1] * V[3 * j + 1] + c * V[3 * i + 2] * V[3 * j + 2]);
  t[0] = entry(0, 0); t[1] = entry(1, 1); t[2] = entry(2, 2);
  t[3] = entry(0, 1); t[4] = entry(0, 2); t[5] = entry(1, 2);
}

function rotate(i: number, j: number): void {
  const off = A[3 * i + j];
  if (Math.abs(off) < 1e-300) return;
  const theta = (A[4 * j] - A[4 * i]) / (2 * off);
  const tan = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.sqrt(theta * theta + 1));
  const cos = 1 / Math.sqrt(tan * tan + 1), sin = tan * cos;
  for (let k = 0; k < 9; k += 3) {
    const x = A[k + i], y = A[k + j], s = V[k + i], t = V[k + j];
    A[k + i] = cos * x - sin * y; A[k + j] = sin * x + cos * y;
    V[k + i] = cos * s - sin * t; V[k + j] = sin * s + cos * t;
  }
  for (let k = 0; k < 3; k++) {
    const x = A[3 * i + k], y = A[3 * j + k];
    A[3 * i + k] = cos * x - sin * y; A[3 * j + k] = sin * x + cos * y;
  }
}
