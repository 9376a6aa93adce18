// The stage: handles on the mould, dragged by mouse, pen or finger or moved by keys; panning and zooming.
import * as edit from "./edit";
import { centreOf } from "./geometry";
import { isCircle, type Mould, type Point, type Tether } from "./model";
import type { View } from "./paint";

export type Part = "corner" | "edge" | "mid" | "tether" | "grip";
export interface Selection { kind: "corner" | "edge" | "tether"; index: number }

export interface Host {
  mould(): Mould;
  symmetry(): edit.Symmetry;
  selection(): Selection | null;
  view(): View;
  select(selection: Selection | null): void;
  change(mould: Mould, isDone: boolean): void;
  look(view: View): void;
  remove(): void;
}

const STEP = 0.1, FINE = 0.01; // l0
const NAMES: Record<Part, string> = { corner: "Corner", edge: "Wall", mid: "Add a corner to wall", tether: "Post or bar", grip: "Size of post or bar" };
const MANY = 40; // corners, above which no dots invite to add more

interface Drag { part: Part; index: number; name: string; start: Mould; from: Point; moved: boolean; altered: Mould | null }

export class Stage {
  private readonly nodes = new Map<string, SVGElement>();
  private readonly layers = new Map<Part, SVGElement>();
  private readonly pointers = new Map<number, Point>();
  private drag: Drag | null = null;
  private pan: { from: Point; view: View; moved: boolean; apart: number } | null = null;

  constructor(private readonly svg: SVGSVGElement, private readonly host: Host) {
    for (const part of ["edge", "tether", "mid", "corner", "grip"] as const) {
      const layer = document.createElementNS("http://www.w3.org/2000/svg", "g");
      this.layers.set(part, layer);
      svg.append(layer);
    }
    svg.addEventListener("pointerdown", (event) => this.down(event));
    svg.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel"] as const) svg.addEventListener(end, (event) => this.up(event));
    svg.addEventListener("keydown", (event) => this.key(event));
    svg.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    svg.addEventListener("focusin", (event) => {
      const [part, index] = this.partOf(event.target as Element);
      if (part && part !== "mid" && part !== "grip" && !this.drag) host.select({ kind: part, index });
    });
  }

  private get size() { return [this.svg.clientWidth, this.svg.clientHeight]; }
  private get scale() { return this.size[0] / this.host.view().span; }

  private toScreen([x, y]: Point): Point {
    const view = this.host.view(), [width, height] = this.size;
    return [width / 2 + (x - view.x) * this.scale, height / 2 - (y - view.y) * this.scale];
  }

  private toPlane([x, y]: Point, view = this.host.view()): Point {
    const [width, height] = this.size, scale = width / view.span;
    return [view.x + (x - width / 2) / scale, view.y - (y - height / 2) / scale];
  }

  private at(event: MouseEvent): Point {
    const box = this.svg.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  private partOf(target: Element | null): [Part | null, number, string] {
    const node = target?.closest<SVGElement>("[data-kind]");
    return node ? [node.dataset.kind as Part, Number(node.dataset.index), node.dataset.name ?? ""] : [null, -1, ""];
  }

  /** Puts handles where the mould is. */
  draw(): void {
    const mould = this.host.mould(), selection = this.host.selection(), kept = new Set<string>();
    const n = mould.outline.length, roomy = n <= MANY;
    const isSelected = (kind: string, index: number) => selection?.kind === kind && selection.index === index;
    mould.outline.forEach((corner, i) => {
      const [x1, y1] = this.toScreen(corner), [x2, y2] = this.toScreen(mould.outline[(i + 1) % n]);
      this.put(kept, "edge", i, "line", { x1, y1, x2, y2 }, isSelected("edge", i));
    });
    mould.tethers.forEach((tether, i) => {
      if (isCircle(tether)) {
        const [cx, cy] = this.toScreen([tether.x, tether.y]);
        this.put(kept, "tether", i, "circle", { cx, cy, r: tether.radius * this.scale }, isSelected("tether", i));
      } else {
        const points = tether.polygon.map((corner) => this.toScreen(corner).join()).join(" ");
        this.put(kept, "tether", i, "polygon", { points }, isSelected("tether", i));
      }
    });
    if (roomy) {
      mould.outline.forEach((corner, i) => {
        const other = mould.outline[(i + 1) % n], [x, y] = this.toScreen([(corner[0] + other[0]) / 2, (corner[1] + other[1]) / 2]);
        const [a, b] = [this.toScreen(corner), this.toScreen(other)];
        if (Math.hypot(a[0] - b[0], a[1] - b[1]) > 44) this.put(kept, "mid", i, "g", { transform: `translate(${x} ${y})` }, false, 3.5);
      });
    }
    mould.outline.forEach((corner, i) => {
      const [x, y] = this.toScreen(corner);
      this.put(kept, "corner", i, "g", { transform: `translate(${x} ${y})` }, isSelected("corner", i), roomy ? 5.5 : 3);
    });
    const chosen = selection?.kind === "tether" ? mould.tethers[selection.index] : undefined;
    if (chosen) {
      for (const [name, place] of grips(chosen, 16 / this.scale)) {
        const [x, y] = this.toScreen(place);
        this.put(kept, "grip", selection!.index, "g", { transform: `translate(${x} ${y})` }, false, 6, name);
      }
    }
    for (const [key, node] of this.nodes) if (!kept.has(key)) { node.remove(); this.nodes.delete(key); }
  }

  /** Gives the keyboard to a handle, once it is drawn. */
  focus(part: Part, index: number): void {
    this.draw();
    this.svg.querySelector<SVGElement>(`[data-kind="${part}"][data-index="${index}"]`)?.focus({ preventScroll: true });
  }

  private put(kept: Set<string>, part: Part, index: number, tag: string, attributes: Record<string, number | string>, selected: boolean, radius = 0, name = ""): void {
    const key = `${part} ${index} ${tag} ${name}`;
    kept.add(key);
    let node = this.nodes.get(key);
    if (!node) {
      node = document.createElementNS("http://www.w3.org/2000/svg", tag) as SVGElement;
      Object.assign(node.dataset, { kind: part, index: String(index), name });
      node.setAttribute("tabindex", "0");
      node.setAttribute("role", "button");
      node.setAttribute("aria-label", `${NAMES[part]} ${name} ${index + 1}`.replace(/ +/g, " "));
      if (tag === "g") {
        for (const r of [Math.max(13, radius), radius]) {
          const circle = document.createElementNS("http://www.w3.org/2000/svg", "circle");
          circle.setAttribute("r", String(r));
          if (r !== radius) circle.setAttribute("class", "hit");
          node.append(circle);
        }
      }
      this.nodes.set(key, node);
      this.layers.get(part)!.append(node);
    }
    for (const [attribute, value] of Object.entries(attributes)) node.setAttribute(attribute, String(value));
    node.setAttribute("class", `${part === "tether" ? "body" : part}${selected ? " selected" : ""}`);
  }

  private down(event: PointerEvent): void {
    const at = this.at(event);
    this.pointers.set(event.pointerId, at);
    this.svg.setPointerCapture(event.pointerId);
    const [part, index, name] = this.partOf(event.target as Element);
    if (this.pointers.size === 2) {
      if (this.drag?.moved) this.host.change(this.drag.start, true);
      this.drag = null;
      this.startPan();
    } else if (part) {
      event.preventDefault();
      (event.target as Element).closest<SVGElement>("[data-kind]")!.focus({ preventScroll: true });
      if (part === "corner" || part === "edge" || part === "tether") this.host.select({ kind: part, index });
      this.drag = { part, index, name, start: this.host.mould(), from: this.toPlane(at), moved: false, altered: null };
    } else this.startPan();
  }

  private startPan(): void {
    const places = [...this.pointers.values()];
    this.pan = { from: mean(places), view: this.host.view(), moved: false, apart: apart(places) };
    this.svg.classList.add("panning");
  }

  private move(event: PointerEvent): void {
    if (!this.pointers.has(event.pointerId)) return;
    const at = this.at(event), last = this.pointers.get(event.pointerId)!;
    this.pointers.set(event.pointerId, at);
    if (this.drag) {
      const from = this.toScreen(this.drag.from);
      if (!this.drag.moved && Math.hypot(at[0] - from[0], at[1] - from[1]) < 3) return;
      this.host.change(this.dragged(this.drag, this.toPlane(at), event.altKey ? FINE : STEP), false);
    } else if (this.pan && (this.pan.moved || Math.hypot(at[0] - last[0], at[1] - last[1]) > 0)) {
      const places = [...this.pointers.values()], now = mean(places), { view, from } = this.pan;
      this.pan.moved ||= Math.hypot(now[0] - from[0], now[1] - from[1]) > 3 || places.length > 1;
      const factor = places.length > 1 && this.pan.apart ? this.pan.apart / apart(places) : 1;
      const span = clamp(view.span * factor, 8, 110), anchor = this.toPlane(from, view), scale = this.size[0] / span;
      this.host.look({ span, x: anchor[0] - (now[0] - this.size[0] / 2) / scale, y: anchor[1] + (now[1] - this.size[1] / 2) / scale });
    }
  }

  private up(event: PointerEvent): void {
    this.pointers.delete(event.pointerId);
    if (this.drag && !this.pointers.size) {
      const { moved } = this.drag;
      this.drag = null;
      if (moved) this.host.change(this.host.mould(), true);
    } else if (this.pan) {
      if (this.pointers.size) { this.startPan(); return; }
      if (!this.pan.moved) this.host.select(null);
      this.pan = null;
      this.svg.classList.remove("panning");
    }
  }

  /** The mould as dragged to a place. */
  private dragged(drag: Drag, to: Point, step: number): Mould {
    drag.moved = true;
    const by: Point = [to[0] - drag.from[0], to[1] - drag.from[1]], symmetry = this.host.symmetry();
    const place = ([x, y]: Point): Point => [edit.rounded(x + by[0], step), edit.rounded(y + by[1], step)];
    if (drag.part === "mid") {
      const { outline } = drag.start, a = outline[drag.index], b = outline[(drag.index + 1) % outline.length];
      const added = edit.addCorner(drag.start, drag.index, [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2], symmetry);
      Object.assign(drag, { part: "corner", index: added.index, start: added.mould });
      this.host.select({ kind: "corner", index: added.index });
    }
    if (drag.part === "corner") return edit.moveCorner(drag.start, drag.index, place(drag.start.outline[drag.index]), symmetry);
    if (drag.part === "edge") return edit.moveEdge(drag.start, drag.index, [edit.rounded(by[0], step), edit.rounded(by[1], step)], symmetry);
    const tether = drag.start.tethers[drag.index];
    if (drag.part === "tether") {
      const centre = centreOf(tether), target = place(centre);
      return edit.withTether(drag.start, drag.index, edit.shifted(tether, [target[0] - centre[0], target[1] - centre[1]]), symmetry);
    }
    const isOnAxis = edit.isOnAxis(drag.start, drag.index, symmetry);
    return edit.withTether(drag.start, drag.index, gripped(tether, drag.name, to, step, isOnAxis), symmetry);
  }

  private key(event: KeyboardEvent): void {
    const [part, index] = this.partOf(event.target as Element), steps = KEYS[event.key], mould = this.host.mould(), symmetry = this.host.symmetry();
    if (!part || event.ctrlKey || event.metaKey) return;
    const size = event.shiftKey ? 1 : event.altKey ? FINE : STEP;
    let next: Mould | null = null;
    if (part === "mid" && event.key === "Enter") {
      const a = mould.outline[index], b = mould.outline[(index + 1) % mould.outline.length];
      next = edit.addCorner(mould, index, [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2], symmetry).mould;
    } else if (event.key === "Delete" || event.key === "Backspace") {
      event.preventDefault();
      this.host.remove();
      return;
    } else if (part === "tether" && (event.key === "+" || event.key === "-")) {
      next = edit.withTether(mould, index, edit.scaledTether(mould.tethers[index], event.key === "+" ? 1.1 : 1 / 1.1), symmetry);
    } else if (steps) {
      const by: Point = [steps[0] * size, steps[1] * size];
      if (part === "corner") {
        const [x, y] = mould.outline[index];
        next = edit.moveCorner(mould, index, [edit.rounded(x + by[0]), edit.rounded(y + by[1])], symmetry);
      } else if (part === "edge") next = edit.moveEdge(mould, index, by, symmetry);
      else if (part === "tether") next = edit.withTether(mould, index, edit.shifted(mould.tethers[index], by), symmetry);
    }
    if (!next) return;
    event.preventDefault();
    this.host.change(next, true);
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    const view = this.host.view(), at = this.at(event), anchor = this.toPlane(at);
    const span = clamp(view.span * Math.exp(clamp(event.deltaY, -120, 120) / 400), 8, 110), scale = this.size[0] / span;
    this.host.look({ span, x: anchor[0] - (at[0] - this.size[0] / 2) / scale, y: anchor[1] + (at[1] - this.size[1] / 2) / scale });
  }
}

const KEYS: Record<string, Point | undefined> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const clamp = (value: number, low: number, high: number) => Math.min(high, Math.max(low, value));
const mean = (places: Point[]): Point => [0, 1].map((axis) => places.reduce((sum, p) => sum + p[axis], 0) / places.length) as Point;
const apart = (places: Point[]) => (places.length > 1 ? Math.hypot(places[0][0] - places[1][0], places[0][1] - places[1][1]) : 0);

/** Where a tether's grips are: a radius, or the ends, sides and turn of a bar, or the size of another shape. */
function grips(tether: Tether, away: number): [string, Point][] {
  if (isCircle(tether)) return [["radius", [tether.x + tether.radius * Math.SQRT1_2 + away * 0.5, tether.y - tether.radius * Math.SQRT1_2 - away * 0.5]]];
  const bar = edit.asRectangle(tether.polygon);
  if (!bar) {
    const [x, y] = centreOf(tether), reach = Math.max(...tether.polygon.map((p) => Math.hypot(p[0] - x, p[1] - y)));
    return [["size", [x + reach * Math.SQRT1_2, y - reach * Math.SQRT1_2]]];
  }
  const c = Math.cos(bar.angle), s = Math.sin(bar.angle);
  const place = (u: number, v: number): Point => [bar.x + u * c - v * s, bar.y + u * s + v * c];
  return [["length", place(bar.length / 2, 0)], ["width", place(0, -bar.width / 2 - away * 0.4)], ["turn", place(-bar.length / 2 - 1.6 * away, 0)]];
}

function gripped(tether: Tether, name: string, to: Point, step: number, isOnAxis: boolean): Tether {
  const least = 0.4, [x, y] = centreOf(tether), away = Math.hypot(to[0] - x, to[1] - y);
  if (isCircle(tether)) return { ...tether, radius: Math.max(least, edit.rounded(away, step)) };
  const bar = edit.asRectangle(tether.polygon);
  if (!bar) {
    const reach = Math.max(...tether.polygon.map((p) => Math.hypot(p[0] - x, p[1] - y)));
    return edit.scaledTether(tether, Math.max(0.2, away / reach));
  }
  const c = Math.cos(bar.angle), s = Math.sin(bar.angle), u = Math.abs((to[0] - x) * c + (to[1] - y) * s), v = Math.abs(-(to[0] - x) * s + (to[1] - y) * c);
  if (name === "length") return { polygon: edit.rectangleRing({ ...bar, length: Math.max(bar.width, edit.rounded(2 * u, step)) }) };
  if (name === "width") return { polygon: edit.rectangleRing({ ...bar, width: clamp(edit.rounded(2 * v, step), 2 * least, bar.length) }) };
  const turn = (isOnAxis ? Math.PI / 2 : (step === STEP ? 5 : 1) * (Math.PI / 180));
  return { polygon: edit.rectangleRing({ ...bar, angle: Math.round((Math.atan2(to[1] - y, to[0] - x) + Math.PI) / turn) * turn }) };
}
