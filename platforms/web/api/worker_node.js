// What a Worker of node:worker_threads runs: startWorker({ worker: new Worker(this file), simd: bytes }).
// @ts-ignore: types of Node are not among those that the package is checked with
import { parentPort } from "node:worker_threads";
import { createServer } from "./worker_server.js";

const answer = createServer((message, transfer) => parentPort.postMessage(message, transfer));
parentPort.on("message", answer);
