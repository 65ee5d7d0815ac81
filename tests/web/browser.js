// A headless Chromium driven over a pipe (DevTools protocol): no package, no port.
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

const FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--use-gl=swiftshader", "--enable-unsafe-swiftshader",
  "--hide-scrollbars", "--mute-audio", "--no-first-run", "--disable-extensions", "--disable-background-networking",
  "--disable-component-update", "--force-color-profile=srgb", "--remote-debugging-pipe"];

export class Browser {
  #child;
  #folder = mkdtempSync(join(tmpdir(), "dcloth-chromium-"));
  #pending = new Map();
  #next = 1;
  #session = "";
  #rest = "";
  /** Errors and warnings that pages wrote, and exceptions that nobody caught. */
  complaints = [];

  /** @param {{ width: number, height: number }} size */
  static async start({ width, height }) {
    const browser = new Browser();
    const own = [`--user-data-dir=${browser.#folder}`, `--window-size=${width},${height}`, "about:blank"];
    browser.#child = spawn("chromium", [...FLAGS, ...own], { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"] });
    browser.#child.stdio[4].setEncoding("utf8").on("data", (text) => browser.#receive(text));
    browser.#child.on("exit", (code) => {
      for (const { reject } of browser.#pending.values()) reject(new Error(`chromium ended with ${code}`));
      browser.#pending.clear();
    });
    const { targetInfos } = await browser.#send("Target.getTargets");
    const { targetId } = targetInfos.find((target) => target.type === "page");
    const { sessionId } = await browser.#send("Target.attachToTarget", { targetId, flatten: true });
    browser.#session = sessionId;
    for (const domain of ["Page", "Runtime", "Log"]) await browser.#send(`${domain}.enable`);
    await browser.resize({ width, height });
    return browser;
  }

  /** @param {{ width: number, height: number }} size */
  resize({ width, height }) {
    return this.#send("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor: 1, mobile: false });
  }

  /** @param {string} url */
  async open(url) {
    const { errorText } = await this.#send("Page.navigate", { url });
    if (errorText) throw new Error(`${url}: ${errorText}`);
  }

  /** The value of an expression in the page; promises are awaited. @param {string} expression */
  async evaluate(expression) {
    const { result, exceptionDetails } = await this.#send("Runtime.evaluate",
      { expression, awaitPromise: true, returnByValue: true });
    if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
    return result.value;
  }

  /** A picture of the window as PNG. */
  async screenshot() {
    const { data } = await this.#send("Page.captureScreenshot", { format: "png" });
    return Buffer.from(data, "base64");
  }

  async close() {
    const ended = new Promise((resolve) => this.#child.once("exit", resolve));
    this.#send("Browser.close").catch(() => {});
    const timer = setTimeout(() => this.#child.kill("SIGKILL"), 20_000);
    await ended;
    clearTimeout(timer);
    rmSync(this.#folder, { recursive: true, force: true, maxRetries: 5 });
  }

  /** @type {(method: string, params?: object) => Promise<any>} */
  #send(method, params = {}) {
    const id = this.#next++;
    const message = { id, method, params, ...(this.#session ? { sessionId: this.#session } : {}) };
    return new Promise((resolve, reject) => {
      this.#pending.set(id, { resolve, reject });
      this.#child.stdio[3].write(`${JSON.stringify(message)}\0`);
    });
  }

  /** @param {string} text */
  #receive(text) {
    const parts = (this.#rest + text).split("\0");
    this.#rest = parts.pop() ?? "";
    for (const part of parts) {
      const { id, result, error, method, params } = JSON.parse(part);
      if (id !== undefined) {
        const waiting = this.#pending.get(id);
        this.#pending.delete(id);
        if (error) waiting?.reject(new Error(error.message));
        else waiting?.resolve(result);
      } else if (method === "Runtime.exceptionThrown") {
        this.complaints.push(params.exceptionDetails.exception?.description ?? params.exceptionDetails.text);
      } else if (method === "Log.entryAdded" && params.entry.level !== "info" && params.entry.level !== "verbose") {
        this.complaints.push(params.entry.text);
      } else if (method === "Runtime.consoleAPICalled" && ["error", "warning", "assert"].includes(params.type)) {
        this.complaints.push(params.args.map((argument) => argument.value ?? argument.description).join(" "));
      }
    }
  }
}
