// The helper for three.js, against the engine fed by hand: a rig with the scale and axes of a Mixamo file.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { copyFileSync, mkdirSync, mkdtempSync, rmSync, symlinkSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import test from "node:test";
import { repository, site } from "./files.js";

for (const space of ["armature", "scene"]) test(`a rig in centimetres, bound in the ${space}'s space`, () => {
  const folder = mkdtempSync(join(tmpdir(), "dcloth-three-"));
  test.after(() => rmSync(folder, { recursive: true }));
  mkdirSync(join(folder, "node_modules"));
  symlinkSync(join(site, "dcloth"), join(folder, "node_modules/dcloth"));
  symlinkSync(join(site, "../npm/node_modules/three"), join(folder, "node_modules/three"));
  writeFileSync(join(folder, "package.json"), '{ "type": "module" }');
  copyFileSync(join(repository, "tests/web/three_host.js"), join(folder, "host.js"));
  copyFileSync(join(repository, "platforms/web/page/figure.js"), join(folder, "figure.js"));
  const done = spawnSync(process.execPath,
      ["--preserve-symlinks", "host.js", site, join(repository, "platforms/web/page"), space],
    { cwd: folder, encoding: "utf8" });
  assert.equal(done.status, 0, done.stderr);
  const said = JSON.parse(done.stdout);
  assert.ok(said.mm < 3, `${said.mm} mm from the skirt of the same poses without a fit`);
  assert.ok(Math.abs(said.scale - 1) < 0.01, `scale ${said.scale}`);
  assert.deepEqual(said.warnings, []);
  assert.ok(said.shared && said.blocks === 0, done.stdout);
  assert.ok(said.vertices === said.uv && said.of_seams > 0 && said.of_seams < 1000, done.stdout);
  assert.ok(said.radius > 0.3 && said.radius < 1 && said.height > 0.5 && said.height < 1, done.stdout);
});
