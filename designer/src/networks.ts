// The networks, run by onnxruntime's WebAssembly on one thread.
import * as ort from "onnxruntime-web/wasm";
import type { Networks } from "./predict";
import type { Model } from "./model";

export interface Parts {
  engine: Uint8Array; // onnxruntime's WebAssembly
  graph: Uint8Array;
  refine: Uint8Array; // empty if the networks work at full resolution
  weights: Uint8Array[]; // float16 of each member: all low bytes, then all high ones
}

/** Float16 numbers, as `Parts.weights` has them, as the bytes of float32 ones. */
function widened(half: Uint8Array): Uint8Array {
  const count = half.length / 2, to = new Uint32Array(count);
  const table = new Float32Array(65536);
  for (let h = 0; h < 65536; h++) {
    const exponent = (h >> 10) & 31, fraction = h & 1023;
    const size = exponent === 0 ? fraction * 2 ** -24 : exponent === 31 ? (fraction ? NaN : Infinity) : (1 + fraction / 1024) * 2 ** (exponent - 15);
    table[h] = h & 32768 ? -size : size;
  }
  const bits = new Uint32Array(table.buffer);
  for (let i = 0; i < count; i++) to[i] = bits[half[i] | (half[count + i] << 8)];
  return new Uint8Array(to.buffer);
}

export async function load(model: Model, parts: Parts): Promise<Networks> {
  ort.env.wasm.numThreads = 1;
  ort.env.wasm.wasmBinary = parts.engine.buffer as ArrayBuffer;
  ort.env.logLevel = "error";
  const options = { executionProviders: ["wasm"], graphOptimizationLevel: "all" as const };
  const sessions: Promise<ort.InferenceSession>[] = [];
  // Members are made when first asked for: the first is enough for a picture.
  const session = (member: number) => (sessions[member] ??= ort.InferenceSession.create(parts.graph, {
    ...options, externalData: [{ path: "weights", data: widened(parts.weights[member]) }],
  }));
  const refine = parts.refine.length ? await ort.InferenceSession.create(parts.refine, options) : null;
  await session(0);
  return {
    async run(member, inputs, cells, noise) {
      const pixels = model.network_pixels;
      const feeds: Record<string, ort.Tensor> = {
        inputs: new ort.Tensor("float32", inputs, [1, inputs.length / pixels ** 2, pixels, pixels]),
        cells: new ort.Tensor("float32", Float32Array.of(cells), [1]),
      };
      if (noise) feeds.noise = new ort.Tensor("float32", noise, [1, noise.length]);
      const found = await (await session(member)).run(feeds);
      return found.fields.data as Float32Array;
    },
    async refine(images) {
      const pixels = model.network_pixels;
      const tensor = new ort.Tensor("float32", images, [images.length / pixels ** 2, pixels, pixels]);
      return (await refine!.run({ images: tensor })).fine.data as Float32Array;
    },
  };
}
