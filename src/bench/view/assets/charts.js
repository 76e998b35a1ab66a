// Charts of the last 30 seconds, each on a separate canvas: curves with their spans, and gaps without a feed.

import { curves as curveColours, DASHES } from "./colours.js";
import { SECONDS } from "./history.js";
import { make, number, setText } from "./text.js";

const INSET = { left: 40, right: 6, top: 8, bottom: 16 };
const MAX_PIXEL_RATIO = 2;
const SVG = "http://www.w3.org/2000/svg";

/// Charts of one arm; recreated for each description.
export class Charts {
  constructor(parent, definitions, history) {
    parent.replaceChildren();
    this.history = history;
    this.charts = definitions.map((definition) => new Chart(parent, definition));
    this.turn = 0;
  }

  /// Draws the next chart: one per frame, so that no frame takes long.
  drawNext(now, colours) {
    if (this.charts.length === 0) return;
    this.charts[this.turn % this.charts.length].draw(this.history, now, colours);
    this.turn += 1;
  }

  drawAll(now, colours) {
    for (const chart of this.charts) chart.draw(this.history, now, colours);
  }
}

class Chart {
  constructor(parent, definition) {
    this.definition = definition;
    const figure = parent.appendChild(make("figure"));
    const caption = figure.appendChild(make("figcaption"));
    caption.append(make("b", "", `${definition.title}, ${definition.unit}`));
    const legend = caption.appendChild(make("span", "legend"));
    this.values = definition.curves.map(({ label }, index) => {
      const entry = legend.appendChild(make("span"));
      const key = document.createElementNS(SVG, "svg");
      const stroke = document.createElementNS(SVG, "line");
      for (const [name, value] of Object.entries({ x1: 0, x2: 18, y1: 4, y2: 4, "stroke-width": 2.2, "stroke-dasharray": DASHES[index % DASHES.length].join(" ") })) stroke.setAttribute(name, value);
      key.append(stroke);
      key.setAttribute("aria-hidden", "true");
      entry.append(key);
      return { stroke, label, text: entry.appendChild(document.createTextNode("")) };
    });
    this.canvas = figure.appendChild(make("canvas"));
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${definition.title} in ${definition.unit}, over the newest 30 seconds`);
    this.context = this.canvas.getContext("2d");
  }

  draw(history, now, { ink, soft, line, theme }) {
    const { canvas, context, definition } = this;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (width === 0 || !context) return;
    const ratio = Math.min(MAX_PIXEL_RATIO, window.devicePixelRatio || 1);
    const [pixels, lines] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== pixels || canvas.height !== lines) [canvas.width, canvas.height] = [pixels, lines];
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const area = { left: INSET.left, right: width - INSET.right, top: INSET.top, bottom: height - INSET.bottom };
    const traces = definition.curves.map((curve) => this.trace(history, curve, now, area));
    const scale = this.scaleOf(traces, area);
    this.frame(scale, area, { soft, line, ink });
    const colours = curveColours(theme);
    traces.forEach((trace, index) => this.curve(trace, scale, colours[index % colours.length], DASHES[index % DASHES.length]));
    this.values.forEach(({ stroke, label, text }, index) => {
      const value = number(history.last(definition.curves[index].value) * definition.factor, definition.digits);
      if (stroke.getAttribute("stroke") !== colours[index % colours.length]) stroke.setAttribute("stroke", colours[index % colours.length]);
      setText(text, `${label} ${value}`);
    });
  }

  /// Returns the curve with one point per px: time, value, minimum and maximum; null for a gap.
  trace(history, { value, low, high }, now, { left, right }) {
    const { factor } = this.definition;
    const [values, lows, highs] = [value, low, high].map((column) => history.columns[column]);
    const points = [];
    let last = null;
    history.forEach((at, time, isAfterGap) => {
      const x = right - ((now - time) / SECONDS) * (right - left);
      const [v, l, h] = [values[at] * factor, lows[at] * factor, highs[at] * factor];
      if (isAfterGap || !Number.isFinite(v)) {
        if (last !== null) points.push(null);
        last = null;
        if (!Number.isFinite(v)) return;
      }
      if (x < left) return;
      if (last !== null && x - last.x < 1) {
        last.v = v;
        last.l = Math.min(last.l, l);
        last.h = Math.max(last.h, h);
      } else {
        last = { x, v, l, h };
        points.push(last);
      }
    });
    return points;
  }

  scaleOf(traces, { top, bottom }) {
    let [low, high] = [0, 0];
    for (const trace of traces) {
      for (const point of trace) {
        if (!point) continue;
        low = Math.min(low, point.l);
        high = Math.max(high, point.h);
      }
    }
    const least = this.definition.least;
    if (high - low < least) high = low < 0 && high <= 0 ? high : low + least;
    if (high - low < least) low = high - least;
    const step = niceStep((high - low) / 3);
    [low, high] = [Math.floor(low / step + 1e-9) * step, Math.ceil(high / step - 1e-9) * step];
    return { low, high, step, y: (v) => bottom - ((v - low) / (high - low)) * (bottom - top) };
  }

  frame({ low, high, step, y }, { left, right, bottom }, { soft, line }) {
    const { context } = this;
    context.lineWidth = 1;
    context.setLineDash([]);
    context.font = "11px system-ui, sans-serif";
    context.fillStyle = soft;
    context.textAlign = "right";
    context.textBaseline = "middle";
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    for (let value = low; value <= high + step / 2; value += step) {
      const at = Math.round(y(value)) + 0.5;
      context.strokeStyle = Math.abs(value) < step / 2 ? soft : line;
      context.globalAlpha = Math.abs(value) < step / 2 ? 0.6 : 1;
      context.beginPath();
      context.moveTo(left, at);
      context.lineTo(right, at);
      context.stroke();
      context.globalAlpha = 1;
      context.fillText(number(value, digits), left - 6, at);
    }
    context.textBaseline = "alphabetic";
    context.textAlign = "left";
    context.fillText("\u221230\u202fs", left, bottom + 14);
    context.textAlign = "right";
    context.fillText("now", right, bottom + 14);
  }

  curve(trace, { y }, colour, dash) {
    const { context } = this;
    for (const run of runs(trace)) {
      if (run.some((point) => point.h - point.l > 1e-9)) {
        context.globalAlpha = 0.2;
        context.fillStyle = colour;
        context.beginPath();
        run.forEach((point, k) => (k === 0 ? context.moveTo(point.x, y(point.h)) : context.lineTo(point.x, y(point.h))));
        for (let k = run.length - 1; k >= 0; k -= 1) context.lineTo(run[k].x, y(run[k].l));
        context.fill();
        context.globalAlpha = 1;
      }
      context.strokeStyle = colour;
      context.lineWidth = 1.5;
      context.setLineDash(dash);
      context.lineDashOffset = -run[0].x;
      context.beginPath();
      run.forEach((point, k) => (k === 0 ? context.moveTo(point.x, y(point.v)) : context.lineTo(point.x, y(point.v))));
      context.stroke();
    }
  }
}

/// Returns the parts of a trace between its gaps.
function runs(trace) {
  const found = [[]];
  for (const point of trace) {
    if (point) found.at(-1).push(point);
    else if (found.at(-1).length > 0) found.push([]);
  }
  return found.filter((run) => run.length > 0);
}

/// Rounds up to 1, 2 or 5 times a power of ten.
function niceStep(rough) {
  const power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].map((digit) => digit * power).find((step) => step >= rough * 0.999) ?? 10 * power;
}
