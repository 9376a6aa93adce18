// What `raptor designer` embeds in the page: the surrogate, the library and the package's constants.

export type Point = [number, number];
export type Ring = Point[]; // corners, the first not repeated

export interface Circle { x: number; y: number; radius: number }
export interface Bar { polygon: Ring }
export type Tether = Circle | Bar;

/** A mould, lengths in l0, the origin at the centre of the image. */
export interface Mould { outline: Ring; tethers: Tether[] }

export interface Cells { delta: number; kappa_nnn: number; kappa_nnnn: number }

export interface Bounds { lower: number; upper: number }

export interface ErrorScale { irreducible: number[]; factors: number[][] }

export interface Model {
  version: string;
  identity: string;
  layers: number;
  pixels: number;
  network_pixels: number;
  members: number;
  noise: number[][][]; // of each member and image under D4, of networks that sample; otherwise empty
  physical: boolean; // whether the networks obey the constraints by construction
  clearance: number;
  threshold: number; // of predictions, calibrated
  own_threshold: number; // of each sample, or of each network's mean
  cast_threshold: number; // of the tissue as cast
  fields: string[];
  scaling: { offset: number[]; scale: number[] };
  calibration: {
    levels: number[];
    fields: ErrorScale;
    measures: ErrorScale;
    usual_disagreement: number;
    usual_distance: number;
    points: string; // of the training set, float32 in base64, a row of descriptors each
  };
  descriptors: { name: string; words: string; unit: string }[];
  bounds: Record<keyof Cells, Bounds>;
  constants: Record<string, number>;
  moulds: { name: string; feature: any }[];
  tissues: { name: string; mould: string; cells: Partial<Cells> }[];
  colours: { sequential: string; diverging: string };
}

export const isCircle = (tether: Tether): tether is Circle => "radius" in tether;

export const pixelSize = (model: Model, pixels = model.pixels) => model.constants.IMAGE_SIZE / pixels;

/** Coordinates of pixel centres along an axis, ascending, l0. */
export function pixelCentres(model: Model, pixels = model.pixels): Float64Array {
  const size = pixelSize(model, pixels);
  return Float64Array.from({ length: pixels }, (_, i) => (i - (pixels - 1) / 2) * size);
}
