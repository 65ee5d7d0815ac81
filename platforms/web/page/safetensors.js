// Reads .safetensors: https://github.com/huggingface/safetensors#format.
const ARRAYS = { F32: Float32Array, F16: Uint16Array, I32: Int32Array };

/**
 * Tensors by name, each { shape, data }; halves stay as their bits. `metadata` is of strings.
 * @param {ArrayBuffer} buffer
 * @param {string} name for messages
 */
export function readSafetensors(buffer, name) {
  const size = buffer.byteLength >= 8 ? Number(new DataView(buffer).getBigUint64(0, true)) : Infinity;
  if (8 + size > buffer.byteLength) {
    throw new Error(`${name}: a header of ${size} bytes in ${buffer.byteLength}; expected: a whole .safetensors file`);
  }
  const header = new TextDecoder().decode(new Uint8Array(buffer, 8, size));
  const { __metadata__: metadata = {}, ...entries } = JSON.parse(header);
  const tensors = {};
  for (const [key, { dtype, shape, data_offsets: [begin, end] }] of Object.entries(entries)) {
    const array = ARRAYS[dtype];
    if (array === undefined) throw new Error(`${name}: ${key}: type ${dtype}; allowed: ${Object.keys(ARRAYS)}`);
    const data = new array(buffer.slice(8 + size + begin, 8 + size + end));
    const count = shape.reduce((product, extent) => product * extent, 1);
    if (data.length !== count) throw new Error(`${name}: ${key}: ${data.length} numbers for shape [${shape}]`);
    tensors[key] = { shape, data };
  }
  return { tensors, metadata };
}

/** @param {string} url */
export async function fetchSafetensors(url) {
  const response = await fetch(url);
  if (!response.ok) throw new Error(`${url}: ${response.status} ${response.statusText}`);
  return readSafetensors(await response.arrayBuffer(), url);
}
