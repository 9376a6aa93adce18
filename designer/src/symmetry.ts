// The eight elements of D4: the twin of raptor.symmetry.

export interface Element { index: number; inverse: number; from: Int32Array; permutation: [number, number][] }

const multiply = (a: number[][], b: number[][]) => a.map((row) => b[0].map((_, j) => row[0] * b[0][j] + row[1] * b[1][j]));

/** All elements for square images of a size; a moved image is image[from[p]]. */
export function elements(pixels: number): Element[] {
  return Array.from({ length: 8 }, (_, index) => {
    const turns = index % 4, mirror = index >= 4;
    let from = Int32Array.from({ length: pixels ** 2 }, (_, p) => {
      const x = p % pixels;
      return p - x + (mirror ? pixels - 1 - x : x);
    });
    let matrix = [[mirror ? -1 : 1, 0], [0, 1]];
    for (let turn = 0; turn < turns; turn++) {
      const last = from;
      from = last.map((_, p) => last[(pixels - 1 - (p % pixels)) * pixels + Math.floor(p / pixels)]);
      matrix = multiply([[0, -1], [1, 0]], matrix);
    }
    return { index, inverse: mirror ? index : (4 - turns) % 4, from, permutation: permutation(matrix) };
  });
}

/** The channel that each image is made from, and its sign: scalars, (sxsz, sysz) a vector, the rest a tensor. */
function permutation(r: number[][]): [number, number][] {
  const turned = r[0][0] === 0;
  const found: [number, number][] = Array.from({ length: 8 }, (_, channel) => [channel, 1]);
  if (turned) { found[2] = [3, 1]; found[3] = [2, 1]; }
  found[5] = [5, r[0][0] * r[1][1] + r[0][1] * r[1][0]];
  found[6] = r[0][0] ? [6, r[0][0]] : [7, r[0][1]];
  found[7] = r[1][0] ? [6, r[1][0]] : [7, r[1][1]];
  return found;
}

/** Moves one image. */
export function movePixels(image: Float32Array, { from }: Element): Float32Array {
  const moved = new Float32Array(image.length);
  for (let p = 0; p < moved.length; p++) moved[p] = image[from[p]];
  return moved;
}

/** Transforms eight fields as scalars, a vector and a tensor. */
export function apply(fields: Float32Array, element: Element): Float32Array {
  const size = element.from.length, moved = new Float32Array(fields.length);
  element.permutation.forEach(([source, sign], channel) => {
    for (let p = 0; p < size; p++) moved[channel * size + p] = sign * fields[source * size + element.from[p]];
  });
  return moved;
}
