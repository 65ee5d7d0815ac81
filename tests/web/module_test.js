// The two modules themselves: what they ask for, what they offer, which instructions they hold, how large they are.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { readFileSync } from "node:fs";
import test from "node:test";
import { gzipSync } from "node:zlib";
import { bytesOf, load, modules, repository } from "./files.js";

const manifest = JSON.parse(readFileSync(`${repository}/engine/abi.json`, "utf8"));
// The modules' bytes, plain and gzipped, as the package's README states them. Every visitor of a web page loads them,
// so whoever changes them by 2% states the new figures there.
const page = readFileSync(`${repository}/platforms/web/README.md`, "utf8");
const stated = Object.fromEntries(Object.entries({ simd: "dcloth.wasm", scalar: "dcloth-scalar.wasm" }).map(
  ([kernels, file]) => {
    const row = page.split("\n").find((line) => line.startsWith(`| \`${file}\` |`));
    return [kernels, row.split("|").slice(3, 5).map((cell) => Number(cell.replaceAll(",", "")))];
  }));

for (const kernels of ["simd", "scalar"]) {
  const module = new WebAssembly.Module(bytesOf(modules[kernels]));

  test(`${kernels}: asks for a clock and nothing else`, () => {
    const imports = WebAssembly.Module.imports(module).map(({ module: from, name, kind }) => `${from}.${name} ${kind}`);
    assert.deepEqual(imports.sort(),
      ["dcloth.now_microseconds function", "env.emscripten_notify_memory_growth function"]);
  });

  test(`${kernels}: offers every function of the ABI with its parameters`, async () => {
    const { exports } = await load(kernels);
    const functions = Object.entries(manifest.functions);
    assert.ok(functions.length > 20);
    for (const [name, declaration] of functions) {
      const parameters = declaration.slice(declaration.indexOf("(") + 1, -1);
      const count = parameters === "void" ? 0 : parameters.split(",").length;
      assert.equal(typeof exports[name], "function", `${name} is missing`);
      assert.equal(exports[name].length, count, `${name}(${parameters})`);
    }
  });

  test(`${kernels}: runs the kernels that it is for`, async () => {
    const engine = await load(kernels);
    assert.equal(engine.instructionSet, kernels === "simd" ? "wasm" : "scalar");
    assert.equal(engine.fallback, kernels === "simd" ? "" : "asked for");
    const validator = spawnSync("wasm-opt", ["--mvp-features", modules[kernels], "-o", "/dev/null"],
      { encoding: "utf8" });
    const said = validator.stdout + validator.stderr;
    // WebAssembly 1.0 alone; the other module must be refused, or the validator checks nothing.
    assert.equal(/wasm-validator error/.test(said), kernels === "simd", said.slice(0, 400));
    if (kernels === "simd") assert.match(said, /v128/);
  });

  test(`${kernels}: is as small as stated`, () => {
    const bytes = bytesOf(modules[kernels]);
    const packed = gzipSync(new Uint8Array(bytes), { level: 9 }).length;
    console.log(`${kernels}: ${bytes.byteLength} bytes, ${packed} gzipped`);
    [bytes.byteLength, packed].forEach((found, i) => {
      const apart = Math.abs(found / stated[kernels][i] - 1);
      assert.ok(apart < 0.02,
          `${found} bytes; platforms/web/README.md states ${stated[kernels][i]}, allowed: within 2%`);
    });
  });
}

test("a module of the other kind is refused", async () => {
  const { loadEngine } = await import(`${process.env.DCLOTH_WEB_SITE}/dcloth/index.js`);
  await assert.rejects(loadEngine({ kernels: "simd", simd: bytesOf(modules.scalar) }),
    /runs scalar kernels; expected: wasm/);
  await assert.rejects(loadEngine({ kernels: "fast" }), /allowed: auto, simd, scalar/);
});

test("without SIMD in the browser the scalar module is taken and said so", async (context) => {
  const { loadEngine } = await import(`${process.env.DCLOTH_WEB_SITE}/dcloth/index.js`);
  const sources = { simd: bytesOf(modules.simd), scalar: bytesOf(modules.scalar) };
  assert.equal((await loadEngine(sources)).instructionSet, "wasm");
  context.mock.method(WebAssembly, "validate", () => false);
  const engine = await loadEngine(sources);
  assert.equal(engine.instructionSet, "scalar");
  assert.match(engine.fallback, /no WebAssembly SIMD/);
  await assert.rejects(loadEngine({ kernels: "simd", ...sources }), /has no WebAssembly SIMD; mend/);
});

test("the build refuses SIMD that the compiler was not told of", () => {
  const compile = (...flags) => spawnSync("em++", ["-std=c++17", "-fsyntax-only", "-DDCLOTH_WASM_SIMD", ...flags,
    "-I", repository, "-isystem", `${process.env.DCLOTH_WEB_SITE}/../root/usr/include`,
    `${repository}/kernels/dispatch.cc`], { encoding: "utf8" });
  const without = compile();
  assert.notEqual(without.status, 0);
  assert.match(without.stderr, /no WebAssembly SIMD target is compiled/);
  const done = compile("-msimd128");
  assert.equal(done.status, 0, done.stderr);
});
