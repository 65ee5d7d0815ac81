import * as abi from "./abi.js";

// Of calls that return a status alone: the words of dcloth.h.
/** @type {Record<number, string>} */
const MEANINGS = {
  [abi.DCLOTH_ERROR_ARGUMENT]: "a null pointer, a wrong count, an unknown flag, or time that is negative or NaN",
  [abi.DCLOTH_ERROR_ALIGNMENT]: "bytes or lent memory not on a multiple of 64",
  [abi.DCLOTH_ERROR_MEMORY]: "lent memory smaller than asked for",
  [abi.DCLOTH_ERROR_FORMAT]: "not a .dcloth file, truncated, or structurally broken",
  [abi.DCLOTH_ERROR_VERSION]: "a .dcloth file of another major version",
  [abi.DCLOTH_ERROR_SEMANTICS]: "structure intact, content impossible",
  [abi.DCLOTH_ERROR_POSE]: "a joint matrix holds NaN, infinity or a number beyond 1e9; the state is untouched",
  [abi.DCLOTH_ERROR_JOINTS]: "the skeleton lacks joints of the model",
  [abi.DCLOTH_ERROR_MODEL]: "a saved state of another model",
};

/** @type {Record<number, string>} */
const NAMES = Object.fromEntries(
  Object.entries(abi)
    .filter(([name]) => name.startsWith("DCLOTH_ERROR_"))
    .map(([name, value]) => [value, name.slice("DCLOTH_ERROR_".length)]),
);

/** What the engine refused. `message` is the engine's own text: field, found, allowed, mend. */
export class DClothError extends Error {
  /**
   * @param {number} status DCLOTH_ERROR_*
   * @param {string} message
   * @param {number | null} offsetBytes where in the model's or state's bytes, or null
   */
  constructor(status, message, offsetBytes = null) {
    super(message);
    this.name = "DClothError";
    this.status = status;
    /** "FORMAT", "POSE" and so on: DCLOTH_ERROR_* without its head. */
    this.statusName = NAMES[status] ?? `status ${status}`;
    this.offsetBytes = offsetBytes;
  }
}

/**
 * For calls that fill no error struct.
 * @param {number} status
 * @param {string} what the call
 */
export function throwUnlessOk(status, what) {
  if (status === abi.DCLOTH_OK) return;
  throw new DClothError(status, `${what}: ${NAMES[status] ?? status}: ${MEANINGS[status] ?? "unknown status"}`);
}
