// What a Web Worker runs; startWorker starts it.
import { createServer } from "./worker_server.js";

const scope = /** @type {any} */ (self);
const answer = createServer((message, transfer) => scope.postMessage(message, transfer));
scope.onmessage = (/** @type {MessageEvent} */ event) => answer(event.data);
