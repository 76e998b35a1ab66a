// One view: its canvas, camera, light and shadow; a scene defines its contents.

import { ArrowShape } from "./arrows.js";
import { Camera } from "./camera.js";
import { MARKED_ARROWS, MARKERS } from "./colours.js";
import { Painter } from "./gl.js";
import { add, cross, multiply, scale, subtract, unit } from "./linear.js";

const MARKER_PX = 9;
const SUN = unit([0.35, -0.3, 1]);
const MAX_PIXEL_RATIO = 2;

export class Stage {
  /// `scene` creates and places the parts for a painter: see hand_scene.js and robot_scene.js.
  constructor(canvas, scene, direction) {
    this.canvas = canvas;
    this.scene = scene;
    this.camera = new Camera(canvas, direction);
    this.painter = Painter.create(canvas);
    this.parts = null;
    this.markers = null;
    if (!this.painter) return;
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.parts = null;
      this.isLost = true;
    });
    canvas.addEventListener("webglcontextrestored", () => {
      this.isLost = false;
      this.painter.restore();
      this.rebuild(this.colours);
    });
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  resize() {
    const { clientWidth, clientHeight } = this.canvas;
    if (clientWidth === 0 || clientHeight === 0) return;
    const ratio = Math.min(MAX_PIXEL_RATIO, window.devicePixelRatio || 1);
    this.canvas.width = Math.round(clientWidth * ratio);
    this.canvas.height = Math.round(clientHeight * ratio);
    this.ratio = this.canvas.width / clientWidth;
    if (this.camera.resize(clientWidth, clientHeight)) this.needsPicture = true;
  }

  /// Recreates the meshes of the scene, for a new description or other colours.
  rebuild(colours) {
    this.colours = colours;
    if (!this.painter || this.isLost || !colours) return;
    for (const part of this.parts?.owned ?? []) this.painter.release(part);
    this.arrowShape?.release(this.painter);
    this.parts = this.scene.build(this.painter, colours);
    this.arrowShape = new ArrowShape(this.painter, this.scene.arrowRadius, colours[this.scene.arrowName]);
    this.needsPicture = true;
  }

  /// Draws the present state of the scene; returns whether there was anything to draw.
  draw() {
    const { painter, camera, parts, colours, scene } = this;
    if (!painter || !parts || this.isLost) return false;
    this.needsPicture = false;
    camera.isChanged = false;
    // Shown only from here on: it would be black before.
    this.canvas.dataset.drawn = "";
    const back = unit(subtract(camera.eye, camera.target));
    const right = unit(cross([0, 0, 1], back));
    const key = unit(add(add(scale(back, 0.55), scale(right, -0.45)), [0, 0, 0.8]));
    painter.begin(this.canvas.width, this.canvas.height, colours.ground, camera.clip(), key, back);
    if (parts.grid) painter.draw(parts.grid, null, { flat: colours.grid, asLines: true });
    const flattened = shadow(scene.floor);
    for (const { part, matrix } of scene.shadows(parts)) painter.draw(part, matrix ? multiply(flattened, matrix) : flattened, { flat: colours.shadow, hasDepth: false });
    for (const { part, matrix } of scene.solids(parts)) painter.draw(part, matrix);
    for (const { part, matrix } of scene.fixed(parts)) painter.draw(part, matrix);
    const acting = scene.arrow();
    for (const { part, flat } of scene.lines(parts)) painter.draw(part, null, { flat, asLines: true, hasDepth: false });
    for (const { part, opacity } of scene.sheets(parts)) painter.draw(part, null, { opacity });
    if (this.markers) this.drawMarkers(acting);
    else if (acting) {
      // Hidden parts of an arrow are visible through the body.
      this.arrowShape.draw(painter, acting, { above: true, opacity: 0.3 });
      this.arrowShape.draw(painter, acting);
    }
    return true;
  }

  drawMarkers(acting) {
    const { painter, scene, markers } = this;
    const isShown = (name) => markers.size === 0 || markers.has(name);
    const disc = (point, colour) => painter.drawDisc(point, colour, MARKER_PX * this.ratio);
    const name = scene.arrowName;
    if (acting && isShown(name)) {
      const marked = MARKED_ARROWS[name];
      this.arrowShape.draw(painter, acting, { flat: marked.shaft, above: true, hasDepth: false });
      disc(acting.tip, marked.tip);
      disc(acting.tail, marked.tail);
    }
    for (const [marker, point] of scene.markers()) {
      if (point && isShown(marker)) disc(point, MARKERS[marker]);
    }
  }
}

/// Returns the transform onto a plane z = height along the light of the sun.
function shadow(height) {
  const [x, y] = [SUN[0] / SUN[2], SUN[1] / SUN[2]];
  return [1, 0, 0, 0, 0, 1, 0, 0, -x, -y, 0, 0, x * height, y * height, height, 1];
}
