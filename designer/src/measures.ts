// Directors, alignment and anisotropy from the fields: the twin of raptor.fields.directors.
import type { Cast } from "./cast";
import { deconvolve } from "./images";
import type { Model } from "./model";

/** Alignment with the mould's long side, and local alignment in any direction, of fields (8, y, x). */
export function alignmentAndAnisotropy(fields: Float32Array, cast: Cast, model: Model): [number, number] {
  const size = fields.length / 8, pixels = Math.sqrt(size), along = new Float32Array(size), across = new Float32Array(size);
  let xx = 0, yy = 0, xy = 0;
  for (let p = 0; p < size; p++) {
    const a = fields[2 * size + p], b = fields[3 * size + p], c = fields[5 * size + p];
    xx += a; yy += b; xy += c;
    along[p] = a - b; across[p] = 2 * c;
  }
  const detail = Math.max(pixels, Math.min(model.constants.DETAIL, model.pixels)); // block averages mix directions
  const [one, other] = [along, across].map((image) => deconvolve(image, pixels, detail));
  let sizes = 0;
  for (let p = 0; p < one.length; p++) sizes += Math.hypot(one[p], other[p]);
  sizes *= (pixels / detail) ** 2;
  const length = Math.hypot(...cast.half), cosine = cast.half[0] / length, sine = cast.half[1] / length;
  const aligned = (cosine ** 2 - sine ** 2) * (xx - yy) + 4 * cosine * sine * xy;
  return xx + yy > 0 ? [aligned / (xx + yy), sizes / (xx + yy)] : [NaN, NaN];
}

export interface Director { x: number; y: number; angle: number; anisotropy: number }

/** Mean axis of the cells, and its strength, in squares of the image that hold tissue. */
export function directors(fields: Float32Array, model: Model, squares = 32): Director[] {
  const pixels = model.pixels, size = pixels ** 2, width = Math.max(1, Math.floor(pixels / squares));
  const count = Math.floor(pixels / width), found: Director[] = [], side = model.constants.IMAGE_SIZE / count;
  for (let j = 0; j < count; j++) {
    for (let i = 0; i < count; i++) {
      let density = 0, along = 0, across = 0;
      for (let y = j * width; y < (j + 1) * width; y++) {
        for (let x = i * width; x < (i + 1) * width; x++) {
          const p = y * pixels + x;
          density += fields[p];
          along += fields[2 * size + p] - fields[3 * size + p];
          across += 2 * fields[5 * size + p];
        }
      }
      if (density / width ** 2 <= model.threshold) continue;
      found.push({
        x: (i - (count - 1) / 2) * side, y: (j - (count - 1) / 2) * side,
        angle: Math.atan2(across, along) / 2, anisotropy: Math.hypot(along, across) / density,
      });
    }
  }
  return found;
}
