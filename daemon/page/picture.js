/** The live picture, the target drawn where it is found, and in words whether it is good to measure in. */

import { socketAddress } from "./api.js";
import { Coverage } from "./coverage.js";
import { fill, h, setText } from "./elements.js";
import { sentenceOf } from "./units.js";

/** Milliseconds for which something must be so before it is said: not every flicker is news. */
const SETTLED = 1000;
/** Milliseconds over which the frame rate is counted. */
const COUNTED = 3000;
/** Kind of what is said while there is no picture. */
const LACKING = "no picture";

/** Fill `element` with the camera's picture, which is live while it is looked at. */
export function mountPicture(element, page, signal) {
  const canvas = h("canvas", { role: "img", "aria-label": "Live picture of the camera", hidden: true });
  const empty = h("p", { class: "empty" }, "No picture");
  const rate = h("span", { class: "rate" });
  const words = h("p", { role: "status", class: "words" });
  const details = h("ul", { class: "faults" });
  const marks = h("input", { type: "checkbox", checked: true });
  const layer = h("input", { type: "checkbox" });
  const covered = h("div", { class: "coverage" });
  fill(
    element,
    h(
      "div",
      { class: "panel-head" },
      h("h2", { id: "picture-title" }, "Camera"),
      rate,
      h("label", {}, marks, " Target"),
      h("label", {}, layer, " Coverage"),
    ),
    h("div", { class: "frame" }, canvas, empty),
    words,
    details,
    covered,
  );
  const coverage = new Coverage(covered, page, signal, () => view.draw());
  const view = new View(canvas, () => marks.checked, coverage);
  const health = new Health(words, details);
  const arrivals = [];

  const feed = new Feed((head, picture) => {
    if (head.code) {
      show(null);
      health.lack(sentenceOf(head.detail));
      return undefined;
    }
    const now = performance.now();
    arrivals.push(now);
    while (arrivals[0] < now - COUNTED) arrivals.shift();
    return createImageBitmap(new Blob([picture], { type: "image/jpeg" })).then((bitmap) => show(bitmap, head));
  });

  function show(bitmap, head = null) {
    empty.hidden = bitmap !== null;
    canvas.hidden &&= bitmap === null;
    canvas.style.visibility = bitmap === null ? "hidden" : ""; // its room stays: what is below must not move under a finger
    view.show(bitmap, head);
    if (head?.detection) health.follow(head.detection);
  }

  marks.addEventListener("change", () => view.draw());
  layer.addEventListener("change", () => page.attempt(() => coverage.show(layer.checked)));
  const counting = setInterval(() => {
    const seconds = (arrivals.at(-1) - arrivals[0]) / 1000;
    const isLive = arrivals.length > 1 && performance.now() - arrivals.at(-1) < COUNTED;
    setText(rate, isLive ? `${((arrivals.length - 1) / seconds).toFixed(1)} pictures/s` : "");
  }, 1000);
  document.addEventListener("visibilitychange", () => feed.wake(), { signal });
  signal.addEventListener("abort", () => {
    clearInterval(counting);
    feed.close();
  });
  page.follow((state) => {
    if (state === null) {
      feed.close();
      arrivals.length = 0;
      setText(rate, "");
      show(null);
      health.lack("There is no picture without a connection.");
    } else {
      feed.open();
    }
  }, signal);
}

/** The socket of pictures: each is asked for when the one before it is on screen, and none while nobody looks. */
class Feed {
  #take;
  #socket = null;
  #owing = false;

  constructor(take) {
    this.#take = take;
  }

  /** Connect where that is not done yet. */
  open() {
    if (this.#socket !== null) return;
    const socket = new WebSocket(socketAddress("camera/live?detect=true"));
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    socket.onopen = () => this.#ask();
    socket.onmessage = async ({ data }) => {
      const length = new DataView(data).getUint32(0);
      const head = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
      if (this.#socket !== socket) return;
      await this.#take(head, new Uint8Array(data, 4 + length));
      if (this.#socket === socket && !head.code) this.#ask();
    };
    socket.onclose = () => {
      if (this.#socket === socket) this.#socket = null; // the next state opens another one
    };
  }

  close() {
    this.#socket?.close();
    this.#socket = null;
    this.#owing = false;
  }

  /** Ask for the picture that was not asked for while the tab was hidden. */
  wake() {
    if (this.#owing && !document.hidden) this.#ask();
  }

  #ask() {
    this.#owing = document.hidden;
    if (!this.#owing && this.#socket?.readyState === WebSocket.OPEN) this.#socket.send("next");
  }
}

/** A picture and what is drawn over it. */
class View {
  #canvas;
  #marked;
  #coverage;
  #bitmap = null;
  #head = null;

  /** `marked` says whether the points of the target are drawn. */
  constructor(canvas, marked, coverage) {
    this.#canvas = canvas;
    this.#marked = marked;
    this.#coverage = coverage;
  }

  /** Show a picture, none where `bitmap` is null. */
  show(bitmap, head) {
    this.#bitmap?.close();
    this.#bitmap = bitmap;
    this.#head = head;
    this.draw();
  }

  draw() {
    const canvas = this.#canvas;
    if (this.#bitmap === null) {
      canvas.width = canvas.width; // clears it
      delete canvas.dataset.points;
      return;
    }
    const { width, height, detection, sequence } = this.#head;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const context = canvas.getContext("2d");
    context.drawImage(this.#bitmap, 0, 0);
    this.#coverage.draw(context, width, height);
    const points = this.#marked() ? (detection?.pixels ?? []) : [];
    canvas.dataset.points = points.length;
    canvas.dataset.sequence = sequence;
    drawPoints(context, points, width / (canvas.clientWidth || width));
  }
}

/** Draw rings around points; `scale`: pixels of the picture to one of the screen. Pixel (0, 0) is a pixel's middle. */
function drawPoints(context, points, scale) {
  for (const [colour, width] of [["#000", 4], ["#3ee06f", 2]]) {
    context.strokeStyle = colour;
    context.lineWidth = width * scale;
    context.beginPath();
    for (const [x, y] of points) {
      context.moveTo(x + 0.5 + 6 * scale, y + 0.5);
      context.arc(x + 0.5, y + 0.5, 6 * scale, 0, 2 * Math.PI);
    }
    context.stroke();
  }
}

/** What is said of the picture. It is spoken when its kind changes, not with each of its numbers. */
class Health {
  #words;
  #details;
  #said = null;
  #coming = null;
  #since = 0;
  #refreshed = 0;

  constructor(words, details) {
    this.#words = words;
    this.#details = details;
  }

  follow(detection) {
    const { found, faults, problem, ids, health } = detection;
    const of = health?.target?.of ?? ids.length;
    const seen = of > ids.length ? "A part of the target is seen" : "The target is seen";
    const verdict = faults.length ? `${seen}, with a reservation.` : `${seen}, and the picture is good to measure in.`;
    const text = found ? verdict : (problem ?? "The target is not seen.");
    const kind = [found ? seen : "", ...faults.map((fault) => fault.kind)].join(" ");
    const now = performance.now();
    if (kind !== this.#coming) [this.#coming, this.#since] = [kind, now];
    const isNews = kind !== this.#said && ([null, LACKING].includes(this.#said) || now - this.#since > SETTLED);
    if (!isNews && (kind !== this.#said || now - this.#refreshed < SETTLED)) return;
    this.#refreshed = now;
    const part = found && of > ids.length ? [`${ids.length} of its ${of} points are found.`] : [];
    const details = [...part, ...faults.map((fault) => sentenceOf(fault.message))];
    this.say(kind, isNews ? text : this.#words.textContent, details, found && !faults.length);
  }

  /** Say why there is no picture. */
  lack(text) {
    this.say(LACKING, text, []);
  }

  say(kind, text, details, isGood = false) {
    if (kind !== this.#said) this.#words.dispatchEvent(new Event("health", { bubbles: true }));
    this.#said = kind;
    this.#words.dataset.kind = isGood ? "good" : "poor";
    setText(this.#words, text);
    fill(this.#details, ...details.map((each) => h("li", {}, each)));
  }
}
