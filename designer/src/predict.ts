// A prediction by the ensemble: the twin of raptor.surrogate.inference and raptor.surrogate.prediction.
import { cast as castMould, type Cast } from "./cast";
import { descriptors, unusual } from "./distribution";
import { blockAverage, enlarge } from "./images";
import { alignmentAndAnisotropy } from "./measures";
import { project, projectDensity, reachable, withSign } from "./physics";
import { held, ratios } from "./shape";
import { apply, elements, movePixels, type Element } from "./symmetry";
import { pixelSize } from "./model";
import type { Cells, ErrorScale, Model, Mould } from "./model";

/** What runs the networks. */
export interface Networks {
  /** Scaled fields (8, y, x) of one image by one member. */
  run(member: number, inputs: Float32Array, cells: number, noise: Float32Array | null): Promise<Float32Array>;
  /** Images (n, y, x) of the networks' raster at full resolution. */
  refine(images: Float32Array): Promise<Float32Array>;
}

export interface Numbers {
  cells: number;
  ratios: [number, number];
  bands: number[] | null; // half widths of the 95 % bands of both ratios, alignment, anisotropy; null of one image
  alignment: number;
  anisotropy: number;
  held: number[]; // chance that tissue encloses each tether
  distance: number;
  disagreement: number | null;
  unusual: string;
}

export interface Prediction {
  fields: Float32Array; // (8, y, x)
  deviation: Float32Array | null; // (8, y, x), half widths of the 95 % bands over 1.96
  samples: { fields: Float32Array; numbers: Numbers }[];
  numbers: Numbers;
  density: Float64Array; // as cast
  depressionPixels: number;
}

export interface Job { mould: Mould; cells: Cells; whole: boolean; samples: number }

/** Called between images; throws to give the work up. */
export type Pause = () => Promise<void>;

export class Predictor {
  private readonly elements: Element[];
  private last: { key: string; cast: Cast; there: Uint8Array; images: Float32Array[] } | null = null;

  constructor(private readonly model: Model, private readonly networks: Networks) {
    this.elements = elements(model.network_pixels);
  }

  async predict(job: Job, pause: Pause): Promise<Prediction> {
    const key = JSON.stringify(job.mould);
    if (this.last?.key !== key) {
      const cast = castMould(job.mould, this.model);
      const { pixels, network_pixels } = this.model;
      const bulk = this.model.layers * pixelSize(this.model) ** 2, relative = cast.density.map((each) => each / bulk);
      const images = [cast.depression, cast.tethers, relative].map((each) => blockAverage(each, pixels, network_pixels));
      this.last = { key, cast, there: reachable(cast.depression, this.model), images };
    }
    const { cast } = this.last;
    const about = unusual(descriptors(cast, job.cells, this.model), this.model);
    const found = await this.ensemble(job, cast, pause);
    found.numbers.distance = about.distance;
    const { disagreement } = found.numbers;
    found.numbers.unusual = about.distance > 1 ? about.words
      : (disagreement ?? 0) > 1 ? `the networks disagree ${disagreement!.toFixed(1)} times as much as is usual` : "";
    return { ...found, density: cast.density, depressionPixels: cast.depression.reduce((sum, each) => sum + each, 0) };
  }

  /** One mean of all networks and images under D4, or of one image by one network, and realisations about it. */
  private async ensemble(job: Job, cast: Cast, pause: Pause) {
    const { model } = this, sampled = model.noise.length > 0;
    const members = job.whole ? model.members : 1, images = job.whole ? this.elements : this.elements.slice(0, 1);
    const raw: Float32Array[] = [], answers: Float32Array[][] = [];
    for (let member = 0; member < members; member++) {
      answers.push([]);
      for (const [k, element] of images.entries()) {
        if (job.whole) await pause();
        const noise = sampled ? Float32Array.from(model.noise[member][k]) : null;
        const answer = await this.answer(job, cast, member, element, noise);
        if (raw.length < job.samples) raw.push(answer.slice());
        answers[member].push(withoutSign(answer));
      }
    }
    const middle = mean(answers.flat());
    const fields = await this.finish(middle, cast, true);
    const numbers = this.numbers(fields, cast);
    [numbers.alignment, numbers.anisotropy] = alignmentAndAnisotropy(middle, cast, model);
    if (!job.whole) return { fields, deviation: null, samples: [], numbers };
    const threshold = model.own_threshold;
    const each: number[][] = [], enclosed: number[][] = [];
    for (const own of sampled ? answers.flat() : answers.map(mean)) {
      const density = await this.density(own, cast);
      each.push([...ratios(density, cast, model, threshold), ...alignmentAndAnisotropy(own, cast, model)]);
      enclosed.push(held(density, cast, model, threshold));
    }
    const columns = [0, 1, 2, 3].map((k) => each.map((row) => row[k]));
    numbers.bands = columns.map((values, k) => band(model.calibration.measures, k, spread(values), 1));
    numbers.held = enclosed[0].map((_, k) => average(enclosed.map((row) => row[k])));
    if (sampled) {
      const found = columns.map((values) => average(values.filter(Number.isFinite)));
      [numbers.ratios, numbers.alignment, numbers.anisotropy] = [[found[0], found[1]], found[2], found[3]];
    }
    const half = this.bands(deviation(answers.flat()), fields);
    numbers.disagreement = disagreement(half.raw, fields, model);
    return { fields, deviation: half.deviation, samples: sampled ? await this.samples(raw, cast) : [], numbers };
  }

  /** Possible tissues, with the numbers of each. */
  private async samples(raw: Float32Array[], cast: Cast) {
    const found: Prediction["samples"] = [];
    for (const answer of raw) {
      const fields = await this.finish(answer, cast, false);
      found.push({ fields, numbers: this.numbers(fields, cast, this.model.own_threshold) });
    }
    return found;
  }

  /** Fields of one image by one member, moved back, in physical units, on the networks' raster. */
  private async answer(job: Job, cast: Cast, member: number, element: Element, noise: Float32Array | null) {
    const { model } = this, pixels = model.network_pixels, size = pixels ** 2, { images } = this.last!;
    const inputs = new Float32Array((images.length + 3) * size);
    images.forEach((image, channel) => {
      const moved = movePixels(image, element);
      for (let p = 0; p < size; p++) inputs[channel * size + p] = 2 * moved[p] - 1;
    });
    (["delta", "kappa_nnn", "kappa_nnnn"] as const).forEach((name, row) => {
      const { lower, upper } = model.bounds[name];
      inputs.fill((job.cells[name] - (upper + lower) / 2) / ((upper - lower) / 2), (images.length + row) * size, (images.length + row + 1) * size);
    });
    const scaled = await this.networks.run(member, inputs, cast.cells * (pixels / model.pixels) ** 2, noise);
    const { offset, scale } = model.scaling, fields = new Float32Array(scaled.length);
    for (let channel = 0; channel < 8; channel++) {
      const factor = Math.fround(scale[channel]), shift = Math.fround(offset[channel]);
      for (let p = channel * size; p < (channel + 1) * size; p++) fields[p] = scaled[p] * factor + shift;
    }
    return apply(fields, this.elements[element.inverse]);
  }

  /** Fields at full resolution that obey the physics. */
  private async finish(fields: Float32Array, cast: Cast, magnitudes: boolean): Promise<Float32Array> {
    const { model } = this, whole = model.network_pixels === model.pixels;
    const fine = whole ? fields.slice() : await this.networks.refine(fields);
    if (magnitudes) withSign(fine, model.pixels ** 2);
    return whole && model.physical ? fine : project(fine, this.last!.there, cast.cells, model.constants.TRACE);
  }

  private async density(fields: Float32Array, cast: Cast): Promise<Float32Array> {
    const { model } = this, whole = model.network_pixels === model.pixels;
    const coarse = fields.slice(0, model.network_pixels ** 2), fine = whole ? coarse : await this.networks.refine(coarse);
    if (!whole || !model.physical) projectDensity(fine, this.last!.there, cast.cells);
    return fine;
  }

  private numbers(fields: Float32Array, cast: Cast, threshold = this.model.threshold): Numbers {
    const size = this.model.pixels ** 2, density = fields.subarray(0, size);
    const [alignment, anisotropy] = alignmentAndAnisotropy(fields, cast, this.model);
    return {
      cells: cast.cells, ratios: ratios(density, cast, this.model, threshold), bands: null, alignment, anisotropy,
      held: held(density, cast, this.model, threshold), distance: 0, disagreement: null, unusual: "",
    };
  }

  private bands(coarse: Float32Array, fields: Float32Array) {
    const { model } = this, size = model.pixels ** 2, small = model.network_pixels ** 2;
    const half = new Float32Array(fields.length);
    let raw: Float32Array = new Float32Array(0);
    for (let channel = 0; channel < 8; channel++) {
      const fine = enlarge(coarse.subarray(channel * small, (channel + 1) * small), model.network_pixels, model.pixels);
      if (!channel) raw = fine;
      for (let p = 0; p < size; p++) {
        half[channel * size + p] = band(model.calibration.fields, channel, fine[p], Math.abs(fields[p])) / 1.96;
      }
    }
    return { deviation: half, raw };
  }
}

/** Half width of the widest band of a quantity with a deviation and a size. */
function band(scale: ErrorScale, k: number, deviation: number, size: number): number {
  const own = scale.irreducible[k] * size;
  return scale.factors[scale.factors.length - 1][k] * Math.sqrt(deviation ** 2 + own ** 2 + 1e-18);
}

function withoutSign(fields: Float32Array): Float32Array {
  for (let i = (fields.length / 8) * 6; i < fields.length; i++) fields[i] = Math.abs(fields[i]);
  return fields;
}

function mean(images: Float32Array[]): Float32Array {
  const found = new Float32Array(images[0].length);
  for (let i = 0; i < found.length; i++) {
    let sum = 0;
    for (const image of images) sum += image[i];
    found[i] = sum / images.length;
  }
  return found;
}

function deviation(images: Float32Array[]): Float32Array {
  const found = mean(images);
  for (let i = 0; i < found.length; i++) {
    let squares = 0;
    for (const image of images) squares += (image[i] - found[i]) ** 2;
    found[i] = Math.sqrt(squares / (images.length - 1));
  }
  return found;
}

function average(values: number[]): number {
  return values.reduce((sum, value) => sum + value, 0) / values.length;
}

/** Standard deviation of some numbers; 0 of a single one. */
function spread(values: number[]): number {
  if (values.length < 2) return 0;
  const middle = average(values);
  return Math.sqrt(values.reduce((sum, v) => sum + (v - middle) ** 2, 0) / (values.length - 1)) || 0;
}

function disagreement(deviation: Float32Array, fields: Float32Array, model: Model): number {
  const size = deviation.length;
  let square = 0, sum = 0, squares = 0;
  for (let p = 0; p < size; p++) { square += deviation[p] ** 2; sum += fields[p]; squares += fields[p] ** 2; }
  const variance = squares / size - (sum / size) ** 2;
  return Math.sqrt(square / size) / (Math.sqrt(variance) + 1e-9) / model.calibration.usual_disagreement;
}
