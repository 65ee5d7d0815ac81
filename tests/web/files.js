// Where the tests find what scripts/test_web.sh has built; the script sets the variables.
import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { readSafetensors } from "../../platforms/web/page/safetensors.js";

export const repository = fileURLToPath(new URL("../..", import.meta.url));

function folder(variable) {
  const value = process.env[variable];
  if (!value) throw new Error(`${variable} is not set; mend: start scripts/test_web.sh`);
  return value;
}

export const site = folder("DCLOTH_WEB_SITE");
export const native = folder("DCLOTH_WEB_NATIVE");
export const sequences = ["walk_turn", "run_stop"];

/** @param {string} path */
export function bytesOf(path) {
  const file = readFileSync(path);
  return file.buffer.slice(file.byteOffset, file.byteOffset + file.length);
}

/** @param {string} path */
export const tensorsOf = (path) => readSafetensors(bytesOf(path), path);

export const modules = { simd: `${site}/dcloth/dcloth.wasm`, scalar: `${site}/dcloth/dcloth-scalar.wasm` };
export const model = `${site}/garment/skirt.dcloth`;

/** @param {"simd" | "scalar"} kernels */
export async function load(kernels) {
  const { loadEngine } = await import(`${site}/dcloth/index.js`);
  return loadEngine({ kernels, [kernels]: bytesOf(modules[kernels]) });
}
