// Serves folders on a free port of this machine, below a path each.
import { createReadStream, statSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";

const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".wasm": "application/wasm",
  ".json": "application/json" };

/**
 * @param {Record<string, string>} folders path below which, folder
 * @returns {Promise<{ origin: string, close: () => void }>}
 */
export async function serve(folders) {
  const prefixes = Object.keys(folders).sort((a, b) => b.length - a.length);
  const server = createServer((request, response) => {
    const path = decodeURIComponent(new URL(request.url ?? "/", "http://x").pathname);
    const prefix = prefixes.find((start) => path.startsWith(start));
    const file = prefix === undefined ? "" : join(folders[prefix], normalize(`/${path.slice(prefix.length)}`));
    const found = file !== "" && statSync(file, { throwIfNoEntry: false })?.isFile();
    // Isolated, so that the page's clock has a grain of 5 us instead of 100.
    response.writeHead(found ? 200 : 404, { "content-type": TYPES[extname(file)] ?? "application/octet-stream",
      "cross-origin-opener-policy": "same-origin", "cross-origin-embedder-policy": "require-corp" });
    if (found) createReadStream(file).pipe(response);
    else response.end();
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", () => resolve(undefined)));
  const address = /** @type {import("node:net").AddressInfo} */ (server.address());
  return { origin: `http://127.0.0.1:${address.port}`, close: () => server.close() };
}
