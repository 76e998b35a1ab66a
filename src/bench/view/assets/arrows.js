// Wrench as an arrow: from its point of application along its force, with a length by its scale.

import { add, along, length, moved, multiply, numbers, origin, scale, stretch, turned, unit } from "./linear.js";
import { Mesh } from "./shapes.js";

const MIN_FORCE = 0.05; // N; below it there is no arrow
const HEAD_SHARE = 0.45; // of an arrow, at most

/// Returns a wrench of the telemetry as force and moment in its frame; null if a number is missing.
export function wrench(list) {
  const six = numbers(list, 6);
  return six && { force: six.slice(0, 3), moment: six.slice(3) };
}

/// Returns the ends of the arrow of a wrench, and its force in N; null without an arrow.
export function arrow(frame, acting, metresPerNewton) {
  if (!frame || !acting) return null;
  const newtons = length(acting.force);
  if (newtons < MIN_FORCE) return null;
  const tail = origin(frame);
  return { tail, tip: add(tail, scale(turned(frame, acting.force), metresPerNewton)), newtons };
}

/// Shaft and head of an arrow; only the shaft is scaled in length.
export class ArrowShape {
  constructor(painter, radius, colour) {
    this.radius = radius;
    this.head = 5.2 * radius;
    this.shaft = painter.upload(new Mesh().cylinder([0, 0, 0], [0, 0, 1], radius, colour));
    this.cone = painter.upload(new Mesh().cylinder([0, 0, 0], [0, 0, this.head], 2.6 * radius, colour, 0));
  }

  draw(painter, { tail, tip }, options) {
    const span = [0, 1, 2].map((axis) => tip[axis] - tail[axis]);
    const size = length(span);
    const share = Math.min(1, (HEAD_SHARE * size) / this.head);
    const frame = along(unit(span), tail);
    const shaft = Math.max(1e-5, size - share * this.head);
    painter.draw(this.shaft, multiply(frame, stretch(share, share, shaft)), options);
    const cone = frame.slice();
    moved(frame, [0, 0, shaft]).forEach((part, axis) => {
      cone[12 + axis] = part;
    });
    painter.draw(this.cone, multiply(cone, stretch(share, share, share)), options);
  }

  release(painter) {
    painter.release(this.shaft);
    painter.release(this.cone);
  }
}
