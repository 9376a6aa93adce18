// The worker: runs the networks beside the page, the newest job first.
import { Fault } from "./cast";
import { load, type Parts } from "./networks";
import { Predictor, type Job } from "./predict";
import type { Model } from "./model";

export type Request = { kind: "load"; model: Model; parts: Record<string, string> } | { kind: "predict"; id: number; job: Job };

class Superseded extends Error {}

let predictor: Promise<Predictor>;
let newest = 0;
let waiting: { id: number; job: Job } | null = null;
let busy = false;

self.onmessage = ({ data }: MessageEvent<Request>) => {
  if (data.kind === "load") {
    predictor = start(data.model, data.parts);
    predictor.then(() => self.postMessage({ kind: "ready" }), (error) => self.postMessage({ kind: "broken", error: String(error) }));
    return;
  }
  newest = data.id;
  waiting = data;
  if (!busy) void work();
};

async function start(model: Model, texts: Record<string, string>): Promise<Predictor> {
  const [engine, graph, refine, ...weights] = await Promise.all(
    ["engine", "graph", "refine", ...Array.from({ length: model.members }, (_, k) => `weights-${k}`)].map((name) => unpacked(texts[name])));
  const parts: Parts = { engine, graph, refine, weights };
  return new Predictor(model, await load(model, parts));
}

async function unpacked(text?: string): Promise<Uint8Array> {
  if (!text) return new Uint8Array();
  const letters = atob(text), packed = new Uint8Array(letters.length);
  for (let i = 0; i < packed.length; i++) packed[i] = letters.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Lets messages in. */
const tick = () => new Promise<void>((resolve) => {
  const { port1, port2 } = new MessageChannel();
  port1.onmessage = () => { port1.close(); resolve(); };
  port2.postMessage(0);
});

async function work() {
  busy = true;
  while (waiting) {
    const { id, job } = waiting;
    waiting = null;
    const pause = async () => {
      await tick();
      if (newest !== id) throw new Superseded();
    };
    try {
      const found = await (await predictor).predict(job, pause);
      const buffers = [found.fields, found.deviation, ...found.samples.map((sample) => sample.fields)];
      const moved = [...new Set(buffers.filter((each) => each !== null).map((each) => each.buffer))];
      self.postMessage({ kind: "predicted", id, whole: job.whole, found }, { transfer: moved });
    } catch (error) {
      if (!(error instanceof Superseded)) {
        self.postMessage({ kind: "failed", id, error: error instanceof Fault ? error.message : String(error) });
      }
    }
    await tick();
  }
  busy = false;
}
