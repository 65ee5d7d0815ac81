// The package as npm installs it: its exports lead to the API and to its types.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { copyFileSync, mkdirSync, mkdtempSync, rmSync, symlinkSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import test from "node:test";
import { repository, site } from "./files.js";

const folder = mkdtempSync(join(tmpdir(), "dcloth-package-"));
mkdirSync(join(folder, "node_modules"));
symlinkSync(join(site, "dcloth"), join(folder, "node_modules/dcloth"));
writeFileSync(join(folder, "package.json"), '{ "type": "module" }');
test.after(() => rmSync(folder, { recursive: true }));

test("TypeScript knows the API and refuses what is wrong", () => {
  copyFileSync(join(repository, "tests/web/consumer.ts"), join(folder, "consumer.ts"));
  const compiler = join(site, "../npm/node_modules/typescript/bin/tsc");
  const flags = ["--noEmit", "--strict", "--target", "es2022", "--lib", "es2022,dom", "--module", "es2022",
    "--moduleResolution", "bundler"];
  const done = spawnSync(process.execPath, [compiler, ...flags, "consumer.ts"], { cwd: folder, encoding: "utf8" });
  assert.equal(done.status, 0, done.stdout + done.stderr);
});

test("Node finds the package and its modules", () => {
  writeFileSync(join(folder, "load.js"), `import { readFileSync } from "node:fs";
    import { createRequire } from "node:module";
    import { loadEngine } from "dcloth";
    const path = createRequire(import.meta.url).resolve("dcloth/dcloth.wasm");
    const engine = await loadEngine({ simd: readFileSync(path) });
    console.log(engine.version, engine.instructionSet);`);
  const done = spawnSync(process.execPath, ["load.js"], { cwd: folder, encoding: "utf8" });
  assert.equal(done.stdout.trim(), "0.2.0 wasm", done.stderr);
});
