// The picture of a design: mould, tissue, directors, posts held and lost, scale and colours, as in the figures.
import { contours } from "d3-contour";
import { bounds, centreOf, longAxis } from "./geometry";
import { isCircle, type Model, type Mould, type Ring, type Tether } from "./model";
import { directors, type Director } from "./measures";
import { palette, type Shown } from "./fields";
import type { Prediction } from "./predict";

export interface View { x: number; y: number; span: number } // centre and width, l0

export interface Scene {
  mould: Mould;
  mm: number | null;
  picture: Picture | null;
  view: View;
  withDirectors: boolean;
  isPlain?: boolean; // without scales
  isStale: boolean; // the mould is no longer the one predicted
}

export const COLOURS = { gel: "#e9e4d4", ink: "#2d2c2a", wall: "#444444", post: "#6b6b6b", warning: "#b5402f", paper: "#fbfaf7", grid: "#efece4" };

/** What of a prediction is drawn, made once. */
export class Picture {
  readonly image: OffscreenCanvas;
  readonly tissue: Path2D; // in l0
  readonly directors: Director[];
  readonly shown: Shown;
  readonly held: number[];

  constructor(model: Model, found: Prediction, fields: Float32Array, held: number[], view: Shown) {
    const { pixels, constants, threshold } = model, size = pixels ** 2;
    this.held = held;
    this.shown = view;
    this.image = coloured(this.shown, pixels, palette(this.shown.diverging ? model.colours.diverging : model.colours.sequential));
    this.directors = directors(fields, model);
    this.tissue = new Path2D();
    const place = (value: number) => (value / pixels - 0.5) * constants.IMAGE_SIZE;
    const [shape] = contours().size([pixels, pixels]).thresholds([threshold])(fields.subarray(0, size) as unknown as number[]);
    for (const ring of shape.coordinates.flat()) {
      ring.forEach(([x, y], i) => (i ? this.tissue.lineTo(place(x), place(y)) : this.tissue.moveTo(place(x), place(y))));
      this.tissue.closePath();
    }
  }
}

function coloured({ values, low, high }: Shown, pixels: number, colours: Uint8Array): OffscreenCanvas {
  const canvas = new OffscreenCanvas(pixels, pixels), context = canvas.getContext("2d")!;
  const image = context.createImageData(pixels, pixels), factor = 255 / (high - low);
  for (let y = 0; y < pixels; y++) {
    for (let x = 0; x < pixels; x++) {
      const level = 3 * Math.min(255, Math.max(0, Math.round((values[y * pixels + x] - low) * factor)));
      const at = 4 * ((pixels - 1 - y) * pixels + x);
      image.data[at] = colours[level]; image.data[at + 1] = colours[level + 1]; image.data[at + 2] = colours[level + 2];
      image.data[at + 3] = 255;
    }
  }
  context.putImageData(image, 0, 0);
  return canvas;
}

const traced = (ring: Ring) => {
  const path = new Path2D();
  ring.forEach(([x, y], i) => (i ? path.lineTo(x, y) : path.moveTo(x, y)));
  path.closePath();
  return path;
};

const tetherPath = (tether: Tether) => {
  if (!isCircle(tether)) return traced(tether.polygon);
  const path = new Path2D();
  path.arc(tether.x, tether.y, tether.radius, 0, 2 * Math.PI);
  return path;
};

/** Draws a scene on a canvas of a size in CSS pixels. */
export function paint(context: CanvasRenderingContext2D, scene: Scene, width: number, height: number, model: Model): void {
  const { view, mould, picture } = scene, scale = width / view.span, pixel = 1 / scale, half = model.constants.IMAGE_SIZE / 2;
  context.save();
  context.fillStyle = COLOURS.paper;
  context.fillRect(0, 0, width, height);
  context.transform(scale, 0, 0, -scale, width / 2 - view.x * scale, height / 2 + view.y * scale);
  drawGrid(context, scene, width, height, half);
  context.fillStyle = COLOURS.gel;
  context.fill(traced(mould.outline));
  if (picture) drawTissue(context, picture, scene, half, pixel);
  context.lineJoin = "round";
  context.lineWidth = 1.6 * pixel;
  context.strokeStyle = COLOURS.wall;
  context.stroke(traced(mould.outline));
  mould.tethers.forEach((tether, i) => drawTether(context, tether, i, !scene.isStale && picture ? picture.held[i] < 0.5 : false, pixel));
  context.restore();
  if (scene.isPlain) return;
  drawScale(context, scene, scale, height);
  if (picture) drawColours(context, picture.shown, width, height, model);
}

function drawGrid(context: CanvasRenderingContext2D, { view, mm }: Scene, width: number, height: number, half: number): void {
  const pixel = view.span / width, unit = mm ?? 1, step = roundLength((view.span * unit) / 12) / unit;
  const tall = (height / width) * view.span;
  context.lineWidth = pixel;
  context.strokeStyle = COLOURS.grid;
  context.beginPath();
  for (let x = Math.ceil((view.x - view.span / 2) / step) * step; x < view.x + view.span / 2; x += step) {
    context.moveTo(x, view.y - tall / 2);
    context.lineTo(x, view.y + tall / 2);
  }
  for (let y = Math.ceil((view.y - tall / 2) / step) * step; y < view.y + tall / 2; y += step) {
    context.moveTo(view.x - view.span / 2, y);
    context.lineTo(view.x + view.span / 2, y);
  }
  context.stroke();
  context.setLineDash([4 * pixel, 4 * pixel]);
  context.strokeStyle = "#cfc9ba";
  context.strokeRect(-half, -half, 2 * half, 2 * half);
  context.setLineDash([]);
}

function drawTissue(context: CanvasRenderingContext2D, picture: Picture, scene: Scene, half: number, pixel: number): void {
  context.save();
  context.globalAlpha = scene.isStale ? 0.35 : 1;
  context.save();
  context.clip(picture.tissue, "evenodd");
  context.imageSmoothingEnabled = true;
  context.imageSmoothingQuality = "high";
  context.scale(1, -1);
  context.drawImage(picture.image, -half, -half, 2 * half, 2 * half);
  context.restore();
  context.lineWidth = pixel;
  context.strokeStyle = "rgba(20, 24, 40, 0.55)";
  context.stroke(picture.tissue);
  if (scene.withDirectors) {
    const lines = new Path2D(), side = (0.9 * (2 * half)) / 32;
    for (const { x, y, angle, anisotropy } of picture.directors) {
      const i = (Math.cos(angle) * anisotropy * side) / 2, j = (Math.sin(angle) * anisotropy * side) / 2;
      lines.moveTo(x - i, y - j);
      lines.lineTo(x + i, y + j);
    }
    context.lineCap = "round";
    context.strokeStyle = "rgba(0, 0, 0, 0.65)";
    context.lineWidth = 0.34;
    context.stroke(lines);
    context.strokeStyle = "white";
    context.lineWidth = 0.2;
    context.stroke(lines);
  }
  context.restore();
  const axis = longAxis(scene.mould.outline), size = Math.hypot(...axis.half), across = [-axis.half[1] / size, axis.half[0] / size];
  const [x0, y0, x1, y1] = bounds(scene.mould.outline), reach = Math.hypot(x1 - x0, y1 - y0);
  context.save();
  context.clip(traced(scene.mould.outline));
  context.setLineDash([3 * pixel, 4 * pixel]);
  context.strokeStyle = "rgba(217, 140, 33, 0.9)";
  context.lineWidth = 1.2 * pixel;
  context.beginPath();
  context.moveTo(axis.centre[0] - reach * across[0], axis.centre[1] - reach * across[1]);
  context.lineTo(axis.centre[0] + reach * across[0], axis.centre[1] + reach * across[1]);
  context.stroke();
  context.restore();
}

function drawTether(context: CanvasRenderingContext2D, tether: Tether, index: number, isLost: boolean, pixel: number): void {
  const path = tetherPath(tether), [x, y] = centreOf(tether);
  context.fillStyle = isLost ? "white" : COLOURS.post;
  context.fill(path);
  context.setLineDash(isLost ? [4 * pixel, 3 * pixel] : []);
  context.lineWidth = (isLost ? 1.8 : 1) * pixel;
  context.strokeStyle = isLost ? COLOURS.warning : COLOURS.ink;
  context.stroke(path);
  context.setLineDash([]);
  if (!isLost) return;
  const arm = 4.5 * pixel;
  context.beginPath();
  context.moveTo(x - arm, y - arm); context.lineTo(x + arm, y + arm);
  context.moveTo(x - arm, y + arm); context.lineTo(x + arm, y - arm);
  context.stroke();
  context.save();
  context.translate(x + 8 * pixel, y + 8 * pixel);
  context.scale(pixel, -pixel);
  context.fillStyle = COLOURS.warning;
  context.font = "600 12px system-ui, sans-serif";
  context.fillText(String(index + 1), 0, 0);
  context.restore();
}

/** The largest of 1, 2 and 5 times a power of ten that is no longer than a length. */
export function roundLength(length: number): number {
  const power = 10 ** Math.floor(Math.log10(length));
  return Math.max(...[1, 2, 5].map((step) => step * power).filter((value) => value <= length * (1 + 1e-9)));
}

function drawScale(context: CanvasRenderingContext2D, { view, mm }: Scene, scale: number, height: number): void {
  const unit = mm ?? 1, length = roundLength(0.2 * view.span * unit), wide = (length / unit) * scale;
  context.save();
  context.fillStyle = COLOURS.ink;
  context.fillRect(14, height - 18, wide, 3);
  context.font = "12px system-ui, sans-serif";
  context.fillText(`${Number(length.toPrecision(3))} ${mm ? "mm" : "l\u2080"}`, 14, height - 25);
  context.restore();
}

function drawColours(context: CanvasRenderingContext2D, shown: Shown, width: number, height: number, model: Model): void {
  const wide = Math.min(200, width * 0.42), left = width - wide - 14, top = height - 20;
  const colours = palette(shown.diverging ? model.colours.diverging : model.colours.sequential);
  context.save();
  const gradient = context.createLinearGradient(left, 0, left + wide, 0);
  for (let k = 0; k <= 16; k++) {
    const c = 3 * Math.min(255, k * 16);
    gradient.addColorStop(k / 16, `rgb(${colours[c]} ${colours[c + 1]} ${colours[c + 2]})`);
  }
  context.fillStyle = "rgba(251, 250, 247, 0.82)";
  context.fillRect(left - 8, top - 38, wide + 16, 58);
  context.fillStyle = gradient;
  context.fillRect(left, top - 16, wide, 8);
  context.fillStyle = COLOURS.ink;
  context.font = "11px system-ui, sans-serif";
  context.textAlign = "right";
  context.fillText(shown.label, left + wide, top - 23, wide + 8);
  const text = (value: number) => value.toFixed(value === 0 ? 0 : shown.digits);
  context.fillText(text(shown.high), left + wide, top + 6);
  context.textAlign = "center";
  context.fillText(text((shown.low + shown.high) / 2), left + wide / 2, top + 6);
  context.textAlign = "left";
  context.fillText(text(shown.low), left, top + 6);
  context.restore();
}

/** The view that shows a mould with room around it, and below for the scales. */
export function fitted(mould: Mould, width: number, height: number): View {
  const [x0, y0, x1, y1] = bounds(mould.outline), rim = 30, below = 70;
  const perPixel = Math.max((x1 - x0) / Math.max(60, width - 2 * rim), (y1 - y0) / Math.max(60, height - rim - below));
  return { x: (x0 + x1) / 2, y: (y0 + y1) / 2 - ((below - rim) / 2) * perPixel, span: width * perPixel };
}
