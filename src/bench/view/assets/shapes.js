// Meshes of triangles: position, normal and colour of each corner. Lengths in m.

import { along, cross, moved, perpendicular, subtract, translation, turned, unit } from "./linear.js";

export const FLOATS = 9;

/// Number of sides of round shapes, and of their shadows: small, for rendering without a graphics processor.
const SIDES = 18;
export const SHADOW_SIDES = 6;

/// Builder of a mesh from shapes; round ones have this number of sides.
export class Mesh {
  constructor(sides = SIDES) {
    this.values = [];
    this.sides = sides;
  }

  get count() {
    return this.values.length / FLOATS;
  }

  corner(position, normal, colour) {
    this.values.push(...position, ...normal, ...colour);
  }

  quad(corners, normals, colour) {
    for (const index of [0, 1, 2, 0, 2, 3]) this.corner(corners[index], normals[index], colour);
    return this;
  }

  face(corners, normal, colour) {
    return this.quad(corners, [normal, normal, normal, normal], colour);
  }

  /// Adds a cylinder, or a cone where `endRadius` is smaller.
  cylinder(from, to, radius, colour, endRadius = radius) {
    const span = subtract(to, from);
    const height = Math.hypot(...span);
    if (height < 1e-6) return this;
    const frame = along(span, from);
    const slope = (radius - endRadius) / height;
    const ring = (k, r, z) => {
      const angle = (2 * Math.PI * k) / this.sides;
      return moved(frame, [r * Math.cos(angle), r * Math.sin(angle), z]);
    };
    const side = (k) => {
      const angle = (2 * Math.PI * k) / this.sides;
      return unit(turned(frame, [Math.cos(angle), Math.sin(angle), slope]));
    };
    const [down, up] = [turned(frame, [0, 0, -1]), turned(frame, [0, 0, 1])];
    const [bottom, top] = [from, to];
    for (let k = 0; k < this.sides; k += 1) {
      const [a, b] = [ring(k, radius, 0), ring(k + 1, radius, 0)];
      const [c, d] = [ring(k + 1, endRadius, height), ring(k, endRadius, height)];
      this.quad([a, b, c, d], [side(k), side(k + 1), side(k + 1), side(k)], colour);
      this.corner(bottom, down, colour);
      this.corner(b, down, colour);
      this.corner(a, down, colour);
      if (endRadius > 0) {
        this.corner(top, up, colour);
        this.corner(d, up, colour);
        this.corner(c, up, colour);
      }
    }
    return this;
  }

  sphere(centre, radius, colour) {
    const [rows, columns] = [Math.ceil(this.sides * 0.4), this.sides];
    const at = (row, column) => {
      const [polar, angle] = [(Math.PI * row) / rows, (2 * Math.PI * column) / columns];
      return [Math.sin(polar) * Math.cos(angle), Math.sin(polar) * Math.sin(angle), Math.cos(polar)];
    };
    for (let row = 0; row < rows; row += 1) {
      for (let column = 0; column < columns; column += 1) {
        const normals = [at(row, column), at(row + 1, column), at(row + 1, column + 1), at(row, column + 1)];
        this.quad(normals.map((n) => [0, 1, 2].map((axis) => centre[axis] + radius * n[axis])), normals, colour);
      }
    }
    return this;
  }

  /// Adds a box with these half sizes, in a frame.
  box(half, colour, frame = translation([0, 0, 0])) {
    for (const axis of [0, 1, 2]) {
      for (const sign of [-1, 1]) {
        const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => {
          const corner = [0, 0, 0];
          corner[axis] = sign * half[axis];
          corner[u] = sign * a * half[u];
          corner[v] = b * half[v];
          return moved(frame, corner);
        });
        const normal = [0, 0, 0];
        normal[axis] = sign;
        this.face(corners, turned(frame, normal), colour);
      }
    }
    return this;
  }

  /// Adds a plate whose face is at z = 0 of `frame`, with round holes on x.
  plate(frame, half, thickness, centres, radius, colour) {
    const borders = centres.map((x, k) => (k === 0 ? -half[0] : (centres[k - 1] + x) / 2)).concat(half[0]);
    centres.forEach((x, k) => this.strip(frame, [borders[k], borders[k + 1], half[1]], x, radius, thickness, colour));
    if (centres.length === 0) return this.box([half[0], half[1], thickness / 2], colour, moveZ(frame, -thickness / 2));
    const at = (p) => moved(frame, p);
    const [w, h] = half;
    const rim = [[-w, -h], [w, -h], [w, h], [-w, h]];
    rim.forEach(([a, b], k) => {
      const [c, d] = rim[(k + 1) % 4];
      const normal = turned(frame, unit([d - b, a - c, 0]));
      this.face([at([a, b, -thickness]), at([c, d, -thickness]), at([c, d, 0]), at([a, b, 0])], normal, colour);
    });
    return this;
  }

  /// Adds both faces around one hole, and the hole's own wall.
  strip(frame, [left, right, h], x, radius, thickness, colour) {
    const corner = (a, b) => Math.atan2(b, a - x);
    const angles = [corner(left, -h), corner(right, -h), corner(right, h), corner(left, h)];
    for (let k = 0; k < 2 * this.sides; k += 1) angles.push(-Math.PI + (Math.PI * k) / this.sides);
    angles.sort((a, b) => a - b);
    angles.push(angles[0] + 2 * Math.PI);
    const outer = (angle) => {
      const [c, s] = [Math.cos(angle), Math.sin(angle)];
      const toSide = c > 1e-9 ? (right - x) / c : c < -1e-9 ? (left - x) / c : Infinity;
      const toEnd = Math.abs(s) > 1e-9 ? h / Math.abs(s) : Infinity;
      const far = Math.min(toSide, toEnd);
      return [x + far * c, far * s];
    };
    const inner = (angle) => [x + radius * Math.cos(angle), radius * Math.sin(angle)];
    for (let k = 0; k + 1 < angles.length; k += 1) {
      const [a, b] = [angles[k], angles[k + 1]];
      if (b - a < 1e-9) continue;
      const at = (point, z) => moved(frame, [...point, z]);
      for (const [z, sign] of [[0, 1], [-thickness, -1]]) {
        this.face([at(inner(a), z), at(outer(a), z), at(outer(b), z), at(inner(b), z)], turned(frame, [0, 0, sign]), colour);
      }
      const wall = [a, b].map((angle) => turned(frame, [-Math.cos(angle), -Math.sin(angle), 0]));
      const corners = [at(inner(a), 0), at(inner(b), 0), at(inner(b), -thickness), at(inner(a), -thickness)];
      this.quad(corners, [wall[0], wall[1], wall[1], wall[0]], colour);
    }
  }

  /// Adds the axes of a frame: x, y and z as thin rods of three colours.
  axes(frame, size, colours) {
    const start = moved(frame, [0, 0, 0]);
    colours.forEach((colour, axis) => {
      const end = [0, 0, 0];
      end[axis] = size;
      this.cylinder(start, moved(frame, end), size * 0.035, colour);
    });
    return this;
  }
}

function moveZ(frame, z) {
  const shifted = frame.slice();
  turned(frame, [0, 0, z]).forEach((part, axis) => {
    shifted[12 + axis] += part;
  });
  return shifted;
}

/// Returns lines of a grid on the plane z, as pairs of points, around a centre.
export function grid(centre, half, step, z) {
  const mesh = new Mesh();
  const [cx, cy] = [Math.round(centre[0] / step) * step, Math.round(centre[1] / step) * step];
  const count = Math.max(1, Math.round(half / step));
  for (let k = -count; k <= count; k += 1) {
    const [x, y] = [cx + k * step, cy + k * step];
    for (const point of [[x, cy - count * step, z], [x, cy + count * step, z], [cx - count * step, y, z], [cx + count * step, y, z]]) {
      mesh.corner(point, [0, 0, 1], [1, 1, 1]);
    }
  }
  return mesh;
}

/// Returns a square panel in the plane through `centre`, and the hatching on it as lines.
export function panel(centre, normal, half, colour) {
  const n = unit(normal);
  const u = perpendicular(n);
  const v = cross(n, u);
  const at = (a, b) => [0, 1, 2].map((axis) => centre[axis] + a * u[axis] + b * v[axis]);
  const sheet = new Mesh().face([at(-half, -half), at(half, -half), at(half, half), at(-half, half)], n, colour);
  const hatching = new Mesh();
  const step = half / 4;
  const put = (a, b) => hatching.corner(at(a, b), n, colour);
  for (let k = -7; k <= 7; k += 1) {
    const c = k * step;
    for (const end of [Math.max(-half, c - half), Math.min(half, c + half)]) put(end, c - end);
  }
  for (const [a, b] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
    put(a * half, b * half);
    put(-b * half, a * half);
  }
  return { sheet, hatching };
}
