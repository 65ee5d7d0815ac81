// The modules' vertices against those of the native command line, `dcloth run`, on the bundled sequences.
import assert from "node:assert/strict";
import test from "node:test";
import { bytesOf, load, model, native, sequences, site, tensorsOf } from "./files.js";
import { compareWithNative } from "./playback.js";

const ALLOWED_MM = 0.1;

for (const kernels of ["simd", "scalar"]) {
  const engine = await load(kernels);
  const skirt = engine.openModel(bytesOf(model), "skirt.dcloth");
  for (const name of sequences) {
    const sequence = tensorsOf(`${site}/garment/${name}.safetensors`);
    const expected = tensorsOf(`${native}/${name}.safetensors`);
    const cloth = skirt.createCloth({ jointNames: JSON.parse(sequence.metadata.joint_names), rowMajor: true });
    for (const how of kernels === "simd" ? ["tick", "update"] : ["update"]) {
      test(`${kernels}, ${name}, ${how}: as native`, () => {
        const result = compareWithNative(cloth, sequence, expected, how);
        console.log(`${kernels} ${skirt.precision} ${name} ${how}: ${result.frames} frames, mean ` +
          `${result.mean.toFixed(5)} mm, largest ${result.max.toFixed(5)} mm from native; a frame ` +
          `${(result.microseconds / 1000).toFixed(2)} ms (p10)`);
        assert.ok(result.max < ALLOWED_MM, `${result.max} mm`);
        assert.ok(result.changed > 5, `the cloth keeps its shape: ${result.changed} mm`);
      });
    }
    if (kernels === "simd") {
      test(`${name}: a fault would be seen`, () => {
        cloth.outsideBody = true; // moves vertices by some millimetres
        assert.ok(compareWithNative(cloth, sequence, expected, "update").max > ALLOWED_MM);
        cloth.outsideBody = false;
      });
    }
  }
}
