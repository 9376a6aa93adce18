// Builds the page of `raptor designer`, without networks, and onnxruntime's WebAssembly, into the package.
import { build } from "esbuild";
import { readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";

const here = dirname(fileURLToPath(import.meta.url));
const target = process.argv[2] ?? join(here, "..", "src", "raptor", "report", "designer");
const options = {
  bundle: true, minify: true, write: false, format: "iife", target: "es2022", charset: "utf8", legalComments: "none",
  absWorkingDir: here, define: { "import.meta.url": "location.href" }, external: ["node:*", "module", "worker_threads"],
};
const bundled = async (entry, more = {}) => (await build({ ...options, ...more, entryPoints: [join("src", entry)] })).outputFiles[0].text;
const worker = await bundled("worker.ts");
const code = {
  name: "worker's code",
  setup: ({ onResolve, onLoad }) => {
    onResolve({ filter: /^worker-code$/ }, () => ({ path: "worker-code", namespace: "code" }));
    onLoad({ filter: /.*/, namespace: "code" }, () => ({ contents: worker, loader: "text" }));
  },
};
const script = (await bundled("main.ts", { plugins: [code] })).replaceAll("</script", "<\\/script");
const style = await bundled("style.css");
const page = readFileSync(join(here, "src", "page.html"), "utf8")
  .replace("/* style */", () => style.trim())
  .replace("/* script */", () => script.trim());
writeFileSync(join(target, "page.html"), page);
const engine = readFileSync(join(here, "node_modules", "onnxruntime-web", "dist", "ort-wasm-simd-threaded.wasm"));
writeFileSync(join(target, "engine.wasm.gz"), gzipSync(engine, { level: 9 }));
