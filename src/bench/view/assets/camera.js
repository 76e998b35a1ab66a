// Pinhole camera that orbits a point. docs/view.md defines its projection; `data-camera` of the canvas has its parameters.

import { add, cross, dot, length, lookAt, multiply, perspective, scale, subtract, unit } from "./linear.js";

const FOV_Y_DEG = 35;
const UP = [0, 0, 1];
const MAX_PITCH = 1.5;
const HOME = { yaw: -0.95, pitch: 0.38 };
const MARGIN = 0.82; // share of the picture that what is fitted may take

const radians = (degrees) => (degrees * Math.PI) / 180;

export class Camera {
  constructor(canvas, direction = HOME) {
    this.canvas = canvas;
    this.home = { ...direction, distance: 1.5, target: [0, 0, 0] };
    this.size = { width: 1, height: 1 };
    this.isStated = false;
    this.reset();
  }

  reset() {
    Object.assign(this, this.home, { target: this.home.target.slice() });
    this.changed();
  }

  /// Looks from one point to another, as the address states; does not move when an arm is fitted.
  state(eye, target) {
    const offset = subtract(eye, target);
    const distance = Math.max(1e-3, length(offset));
    this.home = { yaw: Math.atan2(offset[1], offset[0]), pitch: Math.asin(offset[2] / distance), distance, target };
    this.isStated = true;
    this.reset();
  }

  /// Sets the distance so that all points are in the picture.
  fit(points) {
    if (this.isStated || points.length === 0) return;
    const [low, high] = [Math.min, Math.max].map((pick) => [0, 1, 2].map((axis) => pick(...points.map((point) => point[axis]))));
    const target = scale(add(low, high), 0.5);
    const back = this.direction(this.home);
    const right = unit(cross(UP, back));
    const above = cross(back, right);
    const tangent = Math.tan(radians(FOV_Y_DEG) / 2) * MARGIN;
    const aspect = Math.max(0.4, this.size.width / this.size.height);
    const needed = points.map((point) => {
      const p = subtract(point, target);
      return dot(p, back) + Math.max(Math.abs(dot(p, right)) / (tangent * aspect), Math.abs(dot(p, above)) / tangent);
    });
    this.home = { ...this.home, target, distance: Math.max(0.1, ...needed) };
    this.reset();
  }

  orbit(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.min(MAX_PITCH, Math.max(-MAX_PITCH, this.pitch + pitch));
    this.changed();
  }

  zoom(factor) {
    this.distance = Math.min(50, Math.max(0.05, this.distance * factor));
    this.changed();
  }

  resize(width, height) {
    if (this.size.width === width && this.size.height === height) return false;
    this.size = { width, height };
    this.changed();
    return true;
  }

  direction({ yaw, pitch }) {
    return [Math.cos(pitch) * Math.cos(yaw), Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch)];
  }

  get eye() {
    return add(this.target, scale(this.direction(this), this.distance));
  }

  /// Returns projection times view.
  clip() {
    const near = this.distance / 40;
    const lens = perspective(radians(FOV_Y_DEG), this.size.width / this.size.height, near, this.distance * 40);
    return multiply(lens, lookAt(this.eye, this.target, UP));
  }

  /// Returns the position of a point in the picture, in CSS px from the upper left corner; null behind the camera.
  project(point) {
    const m = this.clip();
    const [x, y, w] = [0, 1, 3].map((row) => m[row] * point[0] + m[4 + row] * point[1] + m[8 + row] * point[2] + m[12 + row]);
    if (w <= 0) return null;
    return [(0.5 + (0.5 * x) / w) * this.size.width, (0.5 - (0.5 * y) / w) * this.size.height];
  }

  changed() {
    const { eye, target, size } = this;
    this.isChanged = true;
    this.canvas.dataset.camera = JSON.stringify({ eye, target, up: UP, fov_y_deg: FOV_Y_DEG, ...size });
  }
}
