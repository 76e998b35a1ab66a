// Vectors as [x, y, z]; rigid transforms and projections as 16 numbers in column-major order, as in WebGL.

export const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a, by) => [a[0] * by, a[1] * by, a[2] * by];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a) => Math.hypot(a[0], a[1], a[2]);

/// Returns the direction of a vector; z for a zero vector.
export function unit(a) {
  const size = length(a);
  return size > 0 ? scale(a, 1 / size) : [0, 0, 1];
}

/// Returns a direction at right angles to a direction.
export function perpendicular(a) {
  return unit(cross(a, Math.abs(a[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]));
}

export function multiply(a, b) {
  const product = new Array(16);
  for (let column = 0; column < 4; column += 1) {
    for (let row = 0; row < 4; row += 1) {
      let sum = 0;
      for (let k = 0; k < 4; k += 1) sum += a[4 * k + row] * b[4 * column + k];
      product[4 * column + row] = sum;
    }
  }
  return product;
}

export const translation = (p) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, p[0], p[1], p[2], 1];
export const stretch = (x, y, z) => [x, 0, 0, 0, 0, y, 0, 0, 0, 0, z, 0, 0, 0, 0, 1];

export function rotationX(angle) {
  const [s, c] = [Math.sin(angle), Math.cos(angle)];
  return [1, 0, 0, 0, 0, c, s, 0, 0, -s, c, 0, 0, 0, 0, 1];
}

export function rotationZ(angle) {
  const [s, c] = [Math.sin(angle), Math.cos(angle)];
  return [c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
}

/// Returns the transform whose z axis is along `z` and whose origin is `origin`.
export function along(z, origin) {
  const up = unit(z);
  const x = perpendicular(up);
  const y = cross(up, x);
  return [...x, 0, ...y, 0, ...up, 0, ...origin, 1];
}

const areNumbers = (list, count) => Array.isArray(list) && list.length >= count && list.slice(0, count).every(Number.isFinite);

/// Returns a list of `count` numbers unchanged; null if one is missing.
export const numbers = (list, count) => (areNumbers(list, count) ? list.slice(0, count) : null);

/// Returns the transform of a pose of the telemetry; null if a number is missing.
export function fromPose(pose) {
  const position = numbers(pose?.position, 3);
  const turn = numbers(pose?.quaternion, 4);
  if (!position || !turn) return null;
  const size = Math.hypot(...turn) || 1;
  const [w, x, y, z] = turn.map((part) => part / size);
  return [
    1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y), 0,
    2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x), 0,
    2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y), 0,
    ...position, 1,
  ];
}

export const origin = (m) => [m[12], m[13], m[14]];

/// Rotates a direction.
export const turned = (m, v) => [0, 1, 2].map((row) => m[row] * v[0] + m[4 + row] * v[1] + m[8 + row] * v[2]);

/// Transforms a point.
export const moved = (m, p) => add(turned(m, p), origin(m));

export function lookAt(eye, target, up) {
  const back = unit(subtract(eye, target));
  const right = unit(cross(up, back));
  const above = cross(back, right);
  return [
    right[0], above[0], back[0], 0, right[1], above[1], back[1], 0, right[2], above[2], back[2], 0,
    -dot(right, eye), -dot(above, eye), -dot(back, eye), 1,
  ];
}

export function perspective(fovY, aspect, near, far) {
  const focal = 1 / Math.tan(fovY / 2);
  const depth = near - far;
  return [focal / aspect, 0, 0, 0, 0, focal, 0, 0, 0, 0, (near + far) / depth, -1, 0, 0, (2 * near * far) / depth, 0];
}
