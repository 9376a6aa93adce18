// The page: what is designed, what is predicted of it, and how both are shown.
import workerCode from "worker-code";
import { cellsOf, decoded, encoded, History, preset, type Design } from "./design";
import * as edit from "./edit";
import { shown, VIEWS } from "./fields";
import { asDXF, asGeoJSON, asSVG, read, Unreadable } from "./files";
import { fault } from "./geometry";
import type { Model, Mould } from "./model";
import { fitted, paint, Picture, type Scene, type View } from "./paint";
import { allowed, byId, cellSliders, fillSelect, inspect, showNumbers, sizeOf, words } from "./panel";
import type { Numbers, Prediction } from "./predict";
import { Stage, type Selection } from "./stage";

interface Result { found: Prediction; whole: boolean; key: string }

const SAMPLES = 8;
const model: Model = JSON.parse(byId("model").textContent!);
const stageBox = byId("stage"), canvas = stageBox.querySelector("canvas")!, svg = stageBox.querySelector("svg")!;
const keptBox = byId("kept"), keptCanvas = keptBox.querySelector("canvas")!;

let design: Design = decoded(location.hash.slice(1)) ?? preset(model, "four_post_rectangle", cellsOf(model, ""), "");
let history = new History(design);
let selection: Selection | null = null;
let view: View = { x: 0, y: 0, span: model.constants.IMAGE_SIZE };
let result: Result | null = null;
let picture: Picture | null = null;
let kept: { design: Design; numbers: Numbers; picture: Picture; found: Prediction } | null = null;
let sample = 0;
let trouble = "";
let isReady = false;
let isDirty = true;
let job = 0;
let wanted: "none" | "quick" | "whole" = "whole";
let asked = 0;
const times: { ready: number; painted: number; drags: number[] } = { ready: 0, painted: 0, drags: [] };

const keyOf = ({ mould, cells }: Design) => JSON.stringify([mould, cells]);
const fieldName = () => byId<HTMLSelectElement>("field").value;

// ---- the engine

const worker = new Worker(URL.createObjectURL(new Blob([workerCode], { type: "text/javascript" })));
const asksOf = new Map<number, { key: string; at: number }>();

worker.onmessage = ({ data }) => {
  if (data.kind === "ready") {
    isReady = true;
    times.ready = performance.now();
    byId("veil").classList.add("done");
  } else if (data.kind === "broken") {
    byId("veil").textContent = `The networks could not be loaded: ${data.error}`;
  } else {
    const ask = asksOf.get(data.id);
    asksOf.delete(data.id);
    if (!ask) return;
    if (data.kind === "failed") trouble ||= ask.key === keyOf(design) ? data.error : "";
    else take({ found: data.found, whole: data.whole, key: ask.key }, ask.at);
  }
  isDirty = true;
};

function take(found: Result, at: number): void {
  const isOld = found.key !== keyOf(design);
  if (isOld && (found.whole || result?.key === keyOf(design))) return;
  if (!found.whole && result?.whole && result.key === found.key) return;
  result = found;
  sample = 0;
  redraw();
  if (!found.whole) times.drags.push(performance.now() - at);
}

/** Makes the picture of the result, of the field and sample that are chosen. */
function redraw(): void {
  if (!result) return;
  const { found } = result, one = found.samples[sample];
  const fields = one?.fields ?? found.fields, view = shown(found, fields, fieldName(), model);
  if (kept) { // on one scale
    const other = shown(kept.found, kept.found.fields, fieldName(), model);
    for (const each of [view, other]) Object.assign(each, { low: Math.min(view.low, other.low), high: Math.max(view.high, other.high) });
    kept.picture = new Picture(model, kept.found, kept.found.fields, kept.numbers.held, other);
  }
  picture = new Picture(model, found, fields, one?.numbers.held ?? found.numbers.held, view);
  isDirty = true;
}

function ask(): void {
  if (!isReady || wanted === "none" || trouble) return;
  const whole = wanted === "whole";
  wanted = "none";
  job += 1;
  asksOf.set(job, { key: keyOf(design), at: asked });
  worker.postMessage({ kind: "predict", id: job, job: { mould: design.mould, cells: design.cells, whole, samples: SAMPLES } });
}

// ---- changes

function change(next: Partial<Design>, isDone: boolean): void {
  const before = keyOf(design);
  design = { ...design, ...next };
  trouble = fault(design.mould, model.constants);
  if (keyOf(design) !== before) {
    wanted = "quick";
    asked = performance.now();
  }
  if (isDone) {
    history.add(design);
    remember();
    if (result?.key !== keyOf(design) || !result.whole) wanted = "whole";
  }
  isDirty = true;
}

function remember(): void {
  try { window.history.replaceState(null, "", `#${encoded(design)}`); } catch { /* some browsers forbid it for files */ }
}

function adopt(next: Design, isNew: boolean): void {
  design = next;
  selection = null;
  if (isNew) view = fitted(design.mould, ...sizeOfStage());
  change({}, true);
  wanted = "whole";
  asked = performance.now();
}

const changeMould = (mould: Mould, isDone: boolean) => change({ mould }, isDone);

function removeSelected(): void {
  if (!selection || selection.kind === "edge") return;
  const { mould, symmetry } = design, { kind, index } = selection;
  selection = null;
  changeMould(kind === "corner" ? edit.removeCorner(mould, index, symmetry) : edit.withTether(mould, index, null, symmetry), true);
}

function addTether(isBar: boolean): void {
  const [x, y] = edit.freePlace(design.mould);
  const tether = isBar ? { polygon: edit.rectangleRing({ x, y, length: 6, width: 1.5, angle: Math.PI / 2 }) } : { x, y, radius: 1.2 };
  const index = design.mould.tethers.length;
  selection = { kind: "tether", index };
  changeMould(edit.addTether(design.mould, tether, design.symmetry), true);
  stage.focus("tether", index);
}

// ---- the stage

const sizeOfStage = (): [number, number] => [stageBox.clientWidth, stageBox.clientHeight];

const stage = new Stage(svg, {
  mould: () => design.mould, symmetry: () => design.symmetry, selection: () => selection, view: () => view,
  select: (next) => { selection = next; isDirty = true; },
  change: changeMould,
  look: (next) => { view = next; isDirty = true; },
  remove: removeSelected,
});

function fit(canvas: HTMLCanvasElement, width: number, height: number): CanvasRenderingContext2D {
  const ratio = window.devicePixelRatio || 1, wide = Math.round(width * ratio), tall = Math.round(height * ratio);
  if (canvas.width !== wide || canvas.height !== tall) Object.assign(canvas, { width: wide, height: tall });
  const context = canvas.getContext("2d")!;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  return context;
}

const scene = (): Scene => ({
  mould: design.mould, mm: design.mm, picture, view, withDirectors: byId<HTMLInputElement>("directors").checked,
  isStale: Boolean(trouble) || (picture !== null && picture.held.length !== design.mould.tethers.length),
});

function frame(): void {
  ask();
  if (isDirty) {
    isDirty = false;
    const [width, height] = sizeOfStage();
    paint(fit(canvas, width, height), scene(), width, height, model);
    if (kept) {
      paint(fit(keptCanvas, keptBox.clientWidth, keptBox.clientHeight), { ...scene(), mould: kept.design.mould, mm: kept.design.mm, picture: kept.picture, isStale: false },
        keptBox.clientWidth, keptBox.clientHeight, model);
    }
    stage.draw();
    showPanel();
    times.painted ||= performance.now();
  }
  requestAnimationFrame(frame);
}

// ---- the panel

const setSliders = cellSliders(model, (cells, isDone) => change({ cells, tissue: "" }, isDone));

function showPanel(): void {
  const isStale = Boolean(trouble), isQuick = Boolean(result && (!result.whole || result.key !== keyOf(design)));
  showNumbers(shownNumbers(), kept?.numbers ?? null, isQuick, isStale);
  showStatus(isQuick);
  setSliders(design.cells);
  byId<HTMLButtonElement>("undo").disabled = !history.canUndo;
  byId<HTMLButtonElement>("redo").disabled = !history.canRedo;
  byId<HTMLButtonElement>("remove").disabled = !selection || selection.kind === "edge";
  byId<HTMLSelectElement>("symmetry").value = design.symmetry;
  byId<HTMLSelectElement>("tissue").value = design.tissue;
  byId("size").textContent = sizeOf(design.mould, design.mm, model.layers);
  const mm = byId<HTMLInputElement>("mm");
  if (document.activeElement !== mm) mm.value = design.mm ? String(design.mm) : "";
  inspect(design, selection, (mould) => changeMould(mould, true));
  byId("then").textContent = kept ? "kept" : "";
  byId("numbers").parentElement!.classList.toggle("comparing", Boolean(kept));
  showSamples();
}

const shownNumbers = () => result?.found.numbers ?? null;

function showStatus(isQuick: boolean): void {
  const status = byId("status"), unusual = result?.found.numbers.unusual;
  status.className = `status ${trouble ? "fault" : unusual ? "unusual" : ""}`;
  status.textContent = trouble || (unusual
    ? `Unusual: ${unusual}. Do not trust these numbers; simulate such a tissue.`
    : !result ? "The first prediction follows as soon as the networks are loaded."
    : isQuick ? "One image by one network, while you draw; bands follow when you let go."
    : model.noise.length ? `Means of ${8 * model.members} samples, each a possible outcome; \u00b1 are 95 % bands for a single tissue.`
    : `Mean of ${model.members} networks and eight images each; \u00b1 are 95 % bands for a single tissue.`);
}

function showSamples(): void {
  const box = byId("samples"), samples = result?.found.samples ?? [];
  box.hidden = !model.noise.length;
  if (!samples.length || box.dataset.key === result!.key) {
    for (const [i, button] of [...box.children].entries()) button.setAttribute("aria-pressed", String(i === sample));
    return;
  }
  box.dataset.key = result!.key;
  box.replaceChildren(...samples.map((each, i) => {
    const button = document.createElement("button"), small = document.createElement("canvas");
    Object.assign(small.style, { width: "104px", height: "66px" });
    button.title = `Sample ${i + 1}: A/A\u2080 ${each.numbers.ratios[0].toFixed(3)}, w/w\u2080 ${each.numbers.ratios[1].toFixed(3)}`;
    button.append(small);
    const drawn = new Picture(model, result!.found, each.fields, each.numbers.held, shown(result!.found, each.fields, fieldName(), model));
    const context = fit(small, 104, 66);
    context.scale(0.2, 0.2);
    paint(context, { ...scene(), picture: drawn, view: fitted(design.mould, 520, 330), withDirectors: false, isStale: false, isPlain: true }, 520, 330, model);
    button.addEventListener("click", () => { sample = i; redraw(); });
    return button;
  }));
}

// ---- buttons and menus

function setUp(): void {
  const fittedTissues = model.tissues.filter((tissue) => Object.keys(tissue.cells).length === 3);
  fillSelect(byId("preset"), {
    "": [["", "choose\u2026"]],
    "Tissues: mould and cells": fittedTissues.map(({ name }) => [`tissue ${name}`, words(name)]),
    "Moulds of the library": model.moulds.map(({ name }) => [`mould ${name}`, words(name)]),
  });
  fillSelect(byId("tissue"), { "": [["", "your own"], ...fittedTissues.map(({ name }): [string, string] => [name, words(name)])] });
  fillSelect(byId("field"), { "": VIEWS });
  byId("about").textContent = `RAPTOR ${model.version}, ${model.members} networks of training ${model.identity}, ${model.layers} layers of cells.`;
  const on = (id: string, event: string, act: (target: any) => void) => byId(id).addEventListener(event, ({ currentTarget }) => act(currentTarget));
  on("preset", "change", (select) => {
    const [kind, name] = select.value.split(" ");
    const tissue = model.tissues.find((each) => each.name === name);
    if (kind === "tissue" && tissue) adopt(preset(model, tissue.mould, cellsOf(model, name), name), true);
    else if (kind === "mould") adopt(preset(model, name, design.cells, design.tissue), true);
    select.value = "";
    select.blur();
  });
  on("tissue", "change", (select) => change(select.value ? { tissue: select.value, cells: cellsOf(model, select.value) } : { tissue: "" }, true));
  on("symmetry", "change", (select) => {
    selection = null;
    change({ symmetry: select.value, mould: edit.symmetrised(design.mould, select.value) }, true);
  });
  on("mm", "change", (input) => change({ mm: Number(input.value) > 0 ? Number(input.value) : null }, true));
  on("field", "change", redraw);
  on("directors", "change", () => { isDirty = true; });
  on("undo", "click", undo);
  on("redo", "click", redo);
  on("post", "click", () => addTether(false));
  on("bar", "click", () => addTether(true));
  on("remove", "click", removeSelected);
  on("fit", "click", showAll);
  on("keep", "click", keep);
  on("open", "click", () => { byId("save").removeAttribute("open"); byId("file").click(); });
  on("file", "change", async (input) => {
    const [file] = input.files;
    if (file) open(await file.text(), file.name);
    input.value = "";
  });
  for (const button of document.querySelectorAll<HTMLButtonElement>("[data-save]")) {
    button.addEventListener("click", () => { byId("save").removeAttribute("open"); void save(button.dataset.save!); });
  }
  document.addEventListener("pointerdown", (event) => { if (!byId("save").contains(event.target as Node)) byId("save").removeAttribute("open"); });
  document.addEventListener("keydown", shortcut);
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", async (event) => {
    event.preventDefault();
    const [file] = event.dataTransfer?.files ?? [];
    if (file) open(await file.text(), file.name);
  });
  new ResizeObserver(() => { isDirty = true; }).observe(byId("stages"));
  window.addEventListener("hashchange", () => {
    const next = decoded(location.hash.slice(1));
    if (next && JSON.stringify(next) !== JSON.stringify(design)) adopt(next, true);
  });
  hint();
}

function open(text: string, name: string): void {
  try {
    const found = read(text, name, model), cells = found.cells ? allowed({ ...design.cells, ...found.cells }, "kappa_nnn", model) : design.cells;
    adopt({ ...design, symmetry: "none", mm: null, ...found, cells, tissue: found.cells ? (found.tissue ?? "") : design.tissue }, true);
  } catch (error) {
    trouble = error instanceof Unreadable ? error.message : `${name} cannot be read as a mould: ${String(error)}`;
    isDirty = true;
  }
}

async function save(kind: string): Promise<void> {
  if (kind === "link") {
    remember();
    await navigator.clipboard?.writeText(location.href).catch(() => undefined);
    return;
  }
  if (kind === "png") {
    const made = await pictureFile();
    download(URL.createObjectURL(made), "png");
    return;
  }
  const text = kind === "geojson" ? asGeoJSON(design) : kind === "svg" ? asSVG(design, model) : asDXF(design);
  download(URL.createObjectURL(new Blob([text], { type: "text/plain" })), kind);
}

function download(address: string, suffix: string): void {
  const link = document.createElement("a");
  Object.assign(link, { href: address, download: `${design.name.replace(/[^\w-]+/g, "_") || "mould"}.${suffix}` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}

/** The picture with its numbers below, at twice the size. */
function pictureFile(): Promise<Blob> {
  const [width, height] = [900, 620], below = 96, drawn = new OffscreenCanvas(2 * width, 2 * (height + below));
  const context = drawn.getContext("2d") as unknown as CanvasRenderingContext2D;
  context.scale(2, 2);
  paint(context, { ...scene(), view: fitted(design.mould, width, height) }, width, height, model);
  context.fillStyle = "white";
  context.fillRect(0, height, width, below);
  context.fillStyle = "#2d2c2a";
  context.font = "600 15px system-ui, sans-serif";
  context.fillText(`${words(design.name)}: \u0394 = ${edit.rounded(design.cells.delta, 1e-4)}, \u03ba = ${edit.rounded(design.cells.kappa_nnn, 1e-4)}, ${edit.rounded(design.cells.kappa_nnnn, 1e-4)}`, 16, height + 28);
  context.font = "14px system-ui, sans-serif";
  const numbers = result?.found.numbers;
  if (numbers) {
    const half = (k: number) => (numbers.bands ? ` \u00b1 ${numbers.bands[k].toFixed(3)}` : "");
    context.fillText(`A/A\u2080 ${numbers.ratios[0].toFixed(3)}${half(0)}    w/w\u2080 ${numbers.ratios[1].toFixed(3)}${half(1)}    alignment ${numbers.alignment.toFixed(2)}    anisotropy ${numbers.anisotropy.toFixed(2)}`, 16, height + 52);
    if (numbers.unusual) context.fillText(`unusual: ${numbers.unusual}`, 16, height + 76);
  }
  return drawn.convertToBlob();
}

function keep(): void {
  if (kept) kept = null;
  else if (result?.whole) kept = { design, numbers: result.found.numbers, picture: picture!, found: result.found };
  keptBox.hidden = !kept;
  byId("keep").textContent = kept ? "Stop comparing" : "Keep to compare";
  keptBox.querySelector("figcaption")!.textContent = kept ? `kept: ${words(kept.design.name)}, \u0394 ${edit.rounded(kept.design.cells.delta, 1e-3)}` : "";
  redraw();
  showAll();
}

function undo(): void { if (history.canUndo) step(history.undo()); }
function redo(): void { if (history.canRedo) step(history.redo()); }

function step(to: Design): void {
  design = to;
  selection = null;
  change({}, false);
  remember();
  wanted = "whole";
  asked = performance.now();
}

function showAll(): void {
  requestAnimationFrame(() => { view = fitted(design.mould, ...sizeOfStage()); isDirty = true; });
}

function shortcut(event: KeyboardEvent): void {
  const isTyping = /^(INPUT|SELECT|TEXTAREA)$/.test((event.target as Element).tagName) && (event.target as HTMLInputElement).type !== "range";
  if (isTyping) return;
  const letter = event.key.toLowerCase();
  if ((event.ctrlKey || event.metaKey) && letter === "z") { event.preventDefault(); (event.shiftKey ? redo : undo)(); }
  else if ((event.ctrlKey || event.metaKey) && letter === "y") { event.preventDefault(); redo(); }
  else if (letter === "f" && !event.ctrlKey && !event.metaKey) showAll();
  else if (event.key === "Escape") { selection = null; isDirty = true; }
}

/** Shown to who has not been here. */
function hint(): void {
  const key = "raptor-designer", box = byId("hint");
  const seen = () => { try { return localStorage.getItem(key); } catch { return null; } };
  box.hidden = Boolean(seen());
  const close = () => {
    box.hidden = true;
    try { localStorage.setItem(key, "seen"); } catch { /* private windows forbid it */ }
  };
  byId("understood").addEventListener("click", close);
}

setUp();
view = fitted(design.mould, ...sizeOfStage());
trouble = fault(design.mould, model.constants);
requestAnimationFrame(frame);
document.addEventListener("DOMContentLoaded", () => {
  const parts: Record<string, string> = {};
  for (const node of document.querySelectorAll<HTMLScriptElement>('script[type="application/gzip"]')) {
    parts[node.id] = node.textContent!;
    node.remove();
  }
  worker.postMessage({ kind: "load", model, parts });
});

/** For scripts: what is designed and predicted. */
Object.assign(window, {
  raptor: {
    model, times,
    get design() { return design; },
    get numbers() { return result?.whole && result.key === keyOf(design) && !trouble ? result.found.numbers : null; },
    get trouble() { return trouble; },
    adopt: (next: Partial<Design>) => adopt({ ...design, symmetry: "none", ...next }, true),
    preset: (name: string) => adopt(preset(model, name, design.cells, ""), true),
    files: () => ({ geojson: asGeoJSON(design), svg: asSVG(design, model), dxf: asDXF(design) }),
    open, picture: pictureFile,
    toScreen: (x: number, y: number) => {
      const box = svg.getBoundingClientRect(), scale = box.width / view.span;
      return [box.left + box.width / 2 + (x - view.x) * scale, box.top + box.height / 2 - (y - view.y) * scale];
    },
  },
});
