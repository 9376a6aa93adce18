// Square images, rows ascending in y: flood fill, labels, block averages, bilinear interpolation.

/** Pixels that are joined, through pixels where `open`, to the border or beyond it: 1 or 0. */
export function outside(open: Uint8Array, pixels: number): Uint8Array {
  const found = new Uint8Array(open.length);
  const stack = new Int32Array(open.length);
  let top = 0;
  const visit = (p: number) => { if (open[p] && !found[p]) { found[p] = 1; stack[top++] = p; } };
  for (let i = 0; i < pixels; i++) {
    visit(i); visit((pixels - 1) * pixels + i); visit(i * pixels); visit(i * pixels + pixels - 1);
  }
  while (top) {
    const p = stack[--top], x = p % pixels;
    if (x > 0) visit(p - 1);
    if (x < pixels - 1) visit(p + 1);
    if (p >= pixels) visit(p - pixels);
    if (p < open.length - pixels) visit(p + pixels);
  }
  return found;
}

/** Boxes [rows, columns], in pixels, of the parts of a mask that touch, corners included. */
export function boxes(mask: Uint8Array, pixels: number): [number, number][] {
  const seen = new Uint8Array(mask.length);
  const found: [number, number][] = [];
  for (let start = 0; start < mask.length; start++) {
    if (!mask[start] || seen[start]) continue;
    let x0 = pixels, x1 = 0, y0 = pixels, y1 = 0;
    const stack = [start];
    seen[start] = 1;
    while (stack.length) {
      const p = stack.pop()!, x = p % pixels, y = (p - x) / pixels;
      x0 = Math.min(x0, x); x1 = Math.max(x1, x); y0 = Math.min(y0, y); y1 = Math.max(y1, y);
      for (let j = Math.max(0, y - 1); j <= Math.min(pixels - 1, y + 1); j++) {
        for (let i = Math.max(0, x - 1); i <= Math.min(pixels - 1, x + 1); i++) {
          const q = j * pixels + i;
          if (mask[q] && !seen[q]) { seen[q] = 1; stack.push(q); }
        }
      }
    }
    found.push([y1 - y0 + 1, x1 - x0 + 1]);
  }
  return found;
}

/** Means over squares of pixels. */
export function blockAverage(image: ArrayLike<number>, from: number, to: number): Float32Array {
  const ratio = from / to, mean = new Float32Array(to * to);
  for (let y = 0; y < from; y++) {
    const row = Math.floor(y / ratio) * to;
    for (let x = 0; x < from; x++) mean[row + Math.floor(x / ratio)] += image[y * from + x];
  }
  for (let p = 0; p < mean.length; p++) mean[p] /= ratio * ratio;
  return mean;
}

const matrices: Record<string, Float64Array> = {};

/** The matrix (to, from) that recovers one axis from block averages: Fourier modes over the transfer function. */
function deconvolution(from: number, to: number): Float64Array {
  const ratio = to / from, found = new Float64Array(to * from);
  for (let i = 0; i < to; i++) {
    for (let k = 0; k < from; k++) {
      let sum = 1;
      for (let wave = 1; wave < from / 2; wave++) {
        const angle = (Math.PI * wave) / to;
        const phase = angle * (2 * i - 2 * ratio * k - (ratio - 1));
        sum += (2 * Math.cos(phase) * ratio * Math.sin(angle)) / Math.sin(ratio * angle);
      }
      found[i * from + k] = sum / from;
    }
  }
  return found;
}

/** An image, smooth and zero at the border, from its block averages: the twin of raptor.fields.resample.deconvolve. */
export function deconvolve(image: Float32Array, from: number, to: number): Float32Array {
  if (from === to) return image;
  const matrix = (matrices[`${from} ${to}`] ??= deconvolution(from, to));
  const rows = new Float64Array(to * from), found = new Float32Array(to * to);
  for (let y = 0; y < to; y++) {
    for (let k = 0; k < from; k++) {
      const weight = matrix[y * from + k];
      for (let x = 0; x < from; x++) rows[y * from + x] += weight * image[k * from + x];
    }
    for (let x = 0; x < to; x++) {
      let sum = 0;
      for (let k = 0; k < from; k++) sum += matrix[x * from + k] * rows[y * from + k];
      found[y * to + x] = sum;
    }
  }
  return found;
}

/** An image enlarged by bilinear interpolation between pixel centres, constant beyond the outer ones. */
export function enlarge(image: ArrayLike<number>, from: number, to: number): Float32Array {
  if (from === to) return Float32Array.from(image);
  const places = Array.from({ length: to }, (_, i) => {
    const at = Math.max(0, ((i + 0.5) * from) / to - 0.5), low = Math.floor(at);
    return [low, Math.min(low + 1, from - 1), at - low];
  });
  const found = new Float32Array(to * to);
  places.forEach(([a, b, t], y) => places.forEach(([c, d, s], x) => {
    const low = image[a * from + c] * (1 - s) + image[a * from + d] * s;
    const high = image[b * from + c] * (1 - s) + image[b * from + d] * s;
    found[y * to + x] = low * (1 - t) + high * t;
  }));
  return found;
}

/** Pixels within a distance, in pixels, of a mask: squared distances by the lower envelope of parabolas. */
export function within(mask: Uint8Array, pixels: number, reach: number): Uint8Array {
  const far = 1e9, column = new Float64Array(mask.length);
  for (let x = 0; x < pixels; x++) {
    let last = far;
    for (let y = 0; y < pixels; y++) {
      last = mask[y * pixels + x] ? 0 : last + 1;
      column[y * pixels + x] = last;
    }
    last = far;
    for (let y = pixels - 1; y >= 0; y--) {
      last = mask[y * pixels + x] ? 0 : last + 1;
      column[y * pixels + x] = Math.min(column[y * pixels + x], last);
    }
  }
  const radius = Math.ceil(reach), most = reach * reach + 1e-9, found = new Uint8Array(mask.length);
  for (let y = 0; y < pixels; y++) {
    for (let x = 0; x < pixels; x++) {
      const up = column[y * pixels + x];
      if (up > radius) continue;
      const span = Math.floor(Math.sqrt(Math.max(0, most - up * up)));
      if (up * up > most) continue;
      for (let i = Math.max(0, x - span); i <= Math.min(pixels - 1, x + span); i++) found[y * pixels + i] = 1;
    }
  }
  return found;
}
