// WebGL: meshes with Lambertian shading, flat colours, discs. One draw call per mesh.

import { FLOATS } from "./shapes.js";

const VERTEX = `
attribute vec3 position; attribute vec3 normal; attribute vec3 colour;
uniform mat4 clip; uniform mat4 model; uniform float size;
varying vec3 v_normal; varying vec3 v_colour;
void main() {
  gl_Position = clip * (model * vec4(position, 1.0));
  gl_PointSize = size;
  v_normal = (model * vec4(normal, 0.0)).xyz;
  v_colour = colour;
}`;

const FRAGMENT = `
precision mediump float;
uniform vec3 key; uniform vec3 eye; uniform vec4 flat_colour; uniform float opacity; uniform float is_disc;
varying vec3 v_normal; varying vec3 v_colour;
void main() {
  if (is_disc > 0.5 && distance(gl_PointCoord, vec2(0.5)) > 0.5) discard;
  if (flat_colour.a > 0.0) { gl_FragColor = flat_colour; return; }
  vec3 n = normalize(v_normal);
  float sky = 0.5 + 0.5 * n.z;
  float light = 0.34 + 0.22 * sky + 0.46 * max(dot(n, key), 0.0) + 0.10 * max(dot(n, eye), 0.0);
  gl_FragColor = vec4(v_colour * light * opacity, opacity);
}`;

let isFastKnown = null;

/// Returns whether a graphics processor renders: without one, antialiasing takes most of the time.
function isFast() {
  isFastKnown ??= findFast();
  return isFastKnown;
}

function findFast() {
  const gl = document.createElement("canvas").getContext("webgl");
  if (!gl) return false;
  let renderer = String(gl.getParameter(gl.RENDERER));
  if (renderer.startsWith("WebKit")) renderer = String(gl.getParameter(gl.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER));
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return !/swiftshader|llvmpipe|softpipe|software|basic render/i.test(renderer);
}

const IDENTITY = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);

/// Renderer of a canvas; `create` returns null if the browser has no WebGL.
export class Painter {
  static create(canvas) {
    const gl = canvas.getContext("webgl", { alpha: false, antialias: isFast(), powerPreference: "low-power" });
    return gl ? new Painter(gl) : null;
  }

  constructor(gl) {
    this.gl = gl;
    this.restore();
  }

  /// Initialises the context, at the start and after its loss.
  restore() {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    ["position", "normal", "colour"].forEach((name, index) => gl.bindAttribLocation(program, index, name));
    gl.linkProgram(program);
    gl.useProgram(program);
    this.at = Object.fromEntries(["clip", "model", "size", "key", "eye", "flat_colour", "opacity", "is_disc"].map((name) => [name, gl.getUniformLocation(program, name)]));
    for (const index of [0, 1, 2]) gl.enableVertexAttribArray(index);
    this.disc = this.upload({ values: new Array(FLOATS).fill(0), count: 1 });
    this.model = new Float32Array(16);
    this.current = null;
  }

  /// Copies a mesh to the context; returns the argument of `draw`.
  upload(mesh) {
    const { gl } = this;
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(mesh.values), gl.STATIC_DRAW);
    this.current = null;
    return { buffer, count: mesh.count };
  }

  release(part) {
    this.gl.deleteBuffer(part.buffer);
    this.current = null;
  }

  /// Starts a picture: `clip` is projection times view; `key` and `eye` are the directions to light and camera.
  begin(width, height, ground, clip, key, eye) {
    const { gl, at } = this;
    gl.viewport(0, 0, width, height);
    gl.clearColor(...ground, 1);
    gl.depthMask(true);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);
    gl.uniformMatrix4fv(at.clip, false, new Float32Array(clip));
    gl.uniform3fv(at.key, key);
    gl.uniform3fv(at.eye, eye);
    gl.uniform1f(at.is_disc, 0);
  }

  /// Draws a mesh. `flat` is a colour without shading; `opacity` below 1 is transparent; `above` ignores depth.
  draw(part, matrix, { flat = null, opacity = 1, above = false, asLines = false, hasDepth = true } = {}) {
    const { gl, at } = this;
    if (this.current !== part.buffer) {
      gl.bindBuffer(gl.ARRAY_BUFFER, part.buffer);
      for (const index of [0, 1, 2]) gl.vertexAttribPointer(index, 3, gl.FLOAT, false, 4 * FLOATS, 12 * index);
      this.current = part.buffer;
    }
    if (matrix) this.model.set(matrix);
    gl.uniformMatrix4fv(at.model, false, matrix ? this.model : IDENTITY);
    gl.uniform4f(at.flat_colour, ...(flat ?? [0, 0, 0]), flat ? 1 : 0);
    gl.uniform1f(at.opacity, opacity);
    const isClear = opacity < 1;
    if (isClear) {
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    }
    if (above) gl.disable(gl.DEPTH_TEST);
    gl.depthMask(hasDepth && !isClear);
    gl.drawArrays(asLines ? gl.LINES : gl.TRIANGLES, 0, part.count);
    gl.depthMask(true);
    if (above) gl.enable(gl.DEPTH_TEST);
    if (isClear) gl.disable(gl.BLEND);
  }

  /// Draws a disc of this diameter in px of the picture, above everything else.
  drawDisc(point, colour, diameter) {
    const { gl, at } = this;
    gl.uniform1f(at.is_disc, 1);
    gl.uniform1f(at.size, diameter);
    gl.disable(gl.DEPTH_TEST);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.disc.buffer);
    for (const index of [0, 1, 2]) gl.vertexAttribPointer(index, 3, gl.FLOAT, false, 4 * FLOATS, 12 * index);
    this.current = this.disc.buffer;
    this.model.set(IDENTITY);
    this.model.set(point, 12);
    gl.uniformMatrix4fv(at.model, false, this.model);
    gl.uniform4f(at.flat_colour, ...colour, 1);
    gl.drawArrays(gl.POINTS, 0, 1);
    gl.enable(gl.DEPTH_TEST);
    gl.uniform1f(at.is_disc, 0);
  }
}
