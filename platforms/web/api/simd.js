// (module (func (result v128) i32.const 0 i8x16.splat)): valid where the browser has SIMD128, nowhere else.
const PROBE = new Uint8Array([
  0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 8, 1, 6, 0, 65, 0, 253, 15, 11,
]);

/** Whether this browser runs WebAssembly SIMD. Chrome 91, Firefox 89, Safari 16.4, Node 16.4 and later do. */
export function hasSimd() {
  return WebAssembly.validate(PROBE);
}
