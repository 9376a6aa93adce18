// Moulds from and to files: GeoJSON, SVG, DXF.
import svgpath from "svgpath";
import { mouldOf, type Design } from "./design";
import { area, bounds, circleRing } from "./geometry";
import { rounded } from "./edit";
import { isCircle, type Model, type Mould, type Point, type Ring, type Tether } from "./model";

export class Unreadable extends Error {}

const ring = (corners: Ring) => [...corners, corners[0]];

/** The mould as the package writes it, with the cells beside. */
export function asGeoJSON({ name, mould, cells, tissue, mm }: Design): string {
  const tethers = mould.tethers.map((each) => (isCircle(each) ? each : { polygon: ring(each.polygon) }));
  const properties = { mould: name, tethers, symmetry: "unknown", ...(mm ? { mm_per_l0: mm } : {}), cells: { ...cells, ...(tissue ? { tissue } : {}) } };
  const feature = { type: "Feature", geometry: { type: "Polygon", coordinates: [ring(mould.outline)] }, properties };
  return `${JSON.stringify({ type: "FeatureCollection", description: "RAPTOR moulds; lengths in l0, origin at the image centre", features: [feature] }, null, 1)}\n`;
}

/** An SVG drawing at true size: the frame is the page, a user unit is l0. */
export function asSVG({ name, mould, mm }: Design, model: Model): string {
  const side = model.constants.IMAGE_SIZE, size = mm ? `${rounded(side * mm, 1e-6)}mm` : String(side);
  const points = (corners: Ring) => corners.map(([x, y]) => `${x},${-y + 0}`).join(" ");
  const shape = (tether: Tether, i: number) => isCircle(tether)
    ? `<circle id="tether-${i + 1}" cx="${tether.x}" cy="${-tether.y + 0}" r="${tether.radius}"/>`
    : `<polygon id="tether-${i + 1}" points="${points(tether.polygon)}"/>`;
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${size}" height="${size}" viewBox="${-side / 2} ${-side / 2} ${side} ${side}">
<title>${name.replace(/[<>&]/g, " ")}</title>
<g fill="none" stroke="black" stroke-width="0.1">
<polygon id="outline" points="${points(mould.outline)}"/>
${mould.tethers.map(shape).join("\n")}
</g>
</svg>
`;
}

/** A DXF drawing (R12) in millimetres, or in l0 where their length is not known. */
export function asDXF({ mould, mm }: Design): string {
  const unit = mm ?? 1, lines: (string | number)[] = [0, "SECTION", 2, "HEADER", 9, "$ACADVER", 1, "AC1009", 9, "$INSUNITS", 70, mm ? 4 : 0, 0, "ENDSEC", 0, "SECTION", 2, "ENTITIES"];
  const closed = (layer: string, corners: Ring) => {
    lines.push(0, "POLYLINE", 8, layer, 66, 1, 70, 1);
    for (const [x, y] of corners) lines.push(0, "VERTEX", 8, layer, 10, rounded(x * unit, 1e-6), 20, rounded(y * unit, 1e-6));
    lines.push(0, "SEQEND", 8, layer);
  };
  closed("outline", mould.outline);
  for (const tether of mould.tethers) {
    if (!isCircle(tether)) closed("tether", tether.polygon);
    else lines.push(0, "CIRCLE", 8, "tether", 10, rounded(tether.x * unit, 1e-6), 20, rounded(tether.y * unit, 1e-6), 40, rounded(tether.radius * unit, 1e-6));
  }
  lines.push(0, "ENDSEC", 0, "EOF");
  return `${lines.join("\n")}\n`;
}

/** What a file gives of a design; lengths in l0. */
export function read(text: string, name: string, model: Model): Partial<Design> & { mould: Mould } {
  const stem = name.replace(/\.[^.]*$/, "");
  if (/\.svg$/i.test(name)) return { name: stem, ...fromSVG(text, model) };
  return { name: stem, ...fromGeoJSON(text, model) };
}

function fromGeoJSON(text: string, model: Model) {
  let document: any;
  try { document = JSON.parse(text); } catch { throw new Unreadable("This file is not GeoJSON: save the mould as GeoJSON or SVG."); }
  const features: any[] = document.type === "FeatureCollection" ? document.features : [document.type === "Feature" ? document : { geometry: document, properties: {} }];
  const first = features?.[0];
  if (features?.length === 1 && /^(Multi)?Polygon$/.test(first?.geometry?.type ?? "")) {
    const about = first.properties ?? {}, found = mouldOf(first), limits = bounds(found.outline);
    const inFrame = Math.max(...limits.map(Math.abs)) <= model.constants.IMAGE_SIZE / 2 + 1e-9;
    const { tissue = "", ...cells } = about.cells ?? {};
    return {
      mould: inFrame ? found : fittedTo(found, model), mm: inFrame ? (about.mm_per_l0 ?? null) : null,
      ...(about.mould ? { name: String(about.mould) } : {}), ...(about.cells ? { cells, tissue } : {}),
    };
  }
  const shapes: Shape[] = [];
  for (const each of features ?? []) {
    const words = Object.values(each.properties ?? {}).join(" "), { type, coordinates } = each.geometry ?? {};
    if (type === "Polygon") shapes.push({ ring: coordinates[0].slice(0, -1), role: roleOf(words) });
    else if (type === "Point" && each.properties?.radius) {
      shapes.push({ ring: [], circle: { x: coordinates[0], y: coordinates[1], radius: Number(each.properties.radius) }, role: "tether" });
    }
  }
  return { mould: fittedTo(assembled(shapes), model), mm: null };
}

interface Shape { ring: Ring; circle?: { x: number; y: number; radius: number }; role: string }

function roleOf(words: string): string {
  const word = words.trim().toLowerCase();
  if (/(^|\s)(outline|depression)/.test(word)) return "outline";
  return /(^|\s)(tether|post)/.test(word) ? "tether" : "";
}

/** The outline, named or the largest, and the rest as tethers. */
function assembled(shapes: Shape[]): Mould {
  const size = (shape: Shape) => (shape.circle ? Math.PI * shape.circle.radius ** 2 : area(shape.ring));
  const candidates = shapes.filter((shape) => shape.role === "outline");
  const [outline] = (candidates.length ? candidates : shapes.filter((shape) => shape.role !== "tether")).sort((a, b) => size(b) - size(a));
  if (!outline) throw new Unreadable("This file draws no closed outline: draw the depression as one closed shape.");
  return {
    outline: outline.circle ? circleRing(outline.circle, 16) : outline.ring,
    tethers: shapes.filter((shape) => shape !== outline && size(shape) > 0).map((shape) => shape.circle ?? { polygon: shape.ring }),
  };
}

function placed(mould: Mould, scale: number, x: number, y: number): Mould {
  const at = ([u, v]: Point): Point => [rounded((u - x) * scale), rounded((v - y) * scale)];
  return {
    outline: mould.outline.map(at),
    tethers: mould.tethers.map((each) => {
      if (!isCircle(each)) return { polygon: each.polygon.map(at) };
      const [u, v] = at([each.x, each.y]);
      return { x: u, y: v, radius: rounded(each.radius * scale) };
    }),
  };
}

/** A mould whose longest side becomes 52 l0, about the middle of the frame. */
function fittedTo(mould: Mould, model: Model): Mould {
  const [x0, y0, x1, y1] = bounds(mould.outline);
  return placed(mould, model.constants.FITTED / Math.max(x1 - x0, y1 - y0), (x0 + x1) / 2, (y0 + y1) / 2);
}

const MM: Record<string, number> = { mm: 1, cm: 10, in: 25.4, pt: 25.4 / 72, pc: 25.4 / 6 };

function fromSVG(text: string, model: Model) {
  const document_ = new DOMParser().parseFromString(text, "image/svg+xml"), root = document_.documentElement;
  if (root.nodeName !== "svg") throw new Unreadable("This file is not SVG: save the drawing as plain SVG.");
  const found = assembled([...root.querySelectorAll("path, polygon, polyline, rect, circle, ellipse")]
    .filter((element) => !element.closest("defs, clipPath, mask, symbol, pattern, marker")).flatMap(shapesOf));
  const box = (root.getAttribute("viewBox") ?? "").split(/[\s,]+/).map(Number), side = model.constants.IMAGE_SIZE;
  const wide = /^\s*([\d.]+)\s*([a-z]*)/.exec(root.getAttribute("width") ?? "");
  const unit = wide && MM[wide[2]] ? (Number(wide[1]) * MM[wide[2]]) / (box[2] || Number(wide[1])) : null; // mm per user unit
  const own = Number(root.getAttribute("data-l0")) || null;
  if (!own && Math.abs(box[2] - side) < 1e-4 && Math.abs(box[3] - side) < 1e-4) {
    return { mould: placed(found, 1, box[0] + side / 2, -(box[1] + side / 2)), mm: unit };
  }
  const [x0, y0, x1, y1] = bounds(found.outline), scale = own ?? model.constants.FITTED / Math.max(x1 - x0, y1 - y0);
  return { mould: placed(found, scale, (x0 + x1) / 2, (y0 + y1) / 2), mm: unit ? Number((unit / scale).toPrecision(6)) : null };
}

/** The closed pieces of an element, y up, transforms applied. */
function shapesOf(element: Element): Shape[] {
  const get = (name: string) => Number(element.getAttribute(name) ?? 0);
  const kind = element.nodeName, words: string[] = [], transforms: string[] = [];
  for (let each: Element | null = element; each && each.nodeName !== "svg"; each = each.parentElement) {
    words.push(each.id, each.getAttribute("class") ?? "", each.getAttribute("inkscape:label") ?? "");
    transforms.unshift(each.getAttribute("transform") ?? "");
  }
  const arc = (rx: number, ry: number) => `M${get("cx") - rx},${get("cy")}a${rx},${ry} 0 1 0 ${2 * rx},0a${rx},${ry} 0 1 0 ${-2 * rx},0z`;
  const [x, y, w, h] = ["x", "y", "width", "height"].map(get);
  const d = kind === "path" ? (element.getAttribute("d") ?? "") : kind === "rect" ? `M${x},${y}h${w}v${h}h${-w}z`
    : kind === "circle" ? arc(get("r"), get("r")) : kind === "ellipse" ? arc(get("rx"), get("ry"))
    : `M${element.getAttribute("points")}z`;
  const role = words.map(roleOf).find(Boolean) ?? "";
  return flattened(d, transforms.join(" ")).map((corners, i) => {
    const circle = circleOf(corners);
    return { ring: corners, ...(circle ? { circle } : {}), role: i && role === "outline" ? "tether" : role };
  });
}

function flattened(d: string, transform: string): Ring[] {
  const rings: Ring[] = [];
  let now: Ring = [];
  svgpath(d).transform(transform).abs().unshort().unarc().iterate((segment, _, x, y) => {
    const [letter, ...n] = segment as [string, ...number[]];
    if (letter === "M") { now = [[n[0], -n[1]]]; rings.push(now); }
    else if (letter === "L") now.push([n[0], -n[1]]);
    else if (letter === "H") now.push([n[0], -y]);
    else if (letter === "V") now.push([x, -n[0]]);
    else if (letter === "C" || letter === "Q") {
      const [ax, ay, bx, by, ex, ey] = letter === "C" ? n : [x + (2 / 3) * (n[0] - x), y + (2 / 3) * (n[1] - y), n[2] + (2 / 3) * (n[0] - n[2]), n[3] + (2 / 3) * (n[1] - n[3]), n[2], n[3]];
      for (let k = 1; k <= 32; k++) {
        const t = k / 32, s = 1 - t, a = s ** 3, b = 3 * s * s * t, c = 3 * s * t * t, e = t ** 3;
        now.push([a * x + b * ax + c * bx + e * ex, -(a * y + b * ay + c * by + e * ey)]);
      }
    }
  });
  return rings.map((corners) => corners.filter((p, i) => i === 0 || Math.hypot(p[0] - corners[i - 1][0], p[1] - corners[i - 1][1]) > 1e-9))
    .map((corners) => (corners.length > 1 && Math.hypot(corners[0][0] - corners[corners.length - 1][0], corners[0][1] - corners[corners.length - 1][1]) < 1e-6 ? corners.slice(0, -1) : corners))
    .filter((corners) => corners.length > 2);
}

/** The circle drawn by many corners, if any. */
function circleOf(corners: Ring) {
  if (corners.length < 16) return null;
  const [x0, y0, x1, y1] = bounds(corners), x = (x0 + x1) / 2, y = (y0 + y1) / 2;
  const reach = corners.map((p) => Math.hypot(p[0] - x, p[1] - y)), most = Math.max(...reach), least = Math.min(...reach);
  return most - least > 2e-3 * most ? null : { x, y, radius: (most + least) / 2 };
}
