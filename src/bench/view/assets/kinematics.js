// Links of an arm from modified Denavit-Hartenberg parameters (Craig 1989, 3.4): link i lies Rx(alpha) Tx(a) Rz(theta + q) Tz(d)
// from link i - 1; a prismatic joint adds to d.

import { IDENTITY, multiply, numbers, rotationX, rotationZ, translation } from "./linear.js";

export const isPrismatic = (joint) => joint.kind === "prismatic";

/// Returns joints whose parameters are numbers, up to the first that is not one; at most nine.
export function sound(joints) {
  const list = Array.isArray(joints) ? joints.slice(0, 9) : [];
  const end = list.findIndex((joint) => numbers([joint?.alpha, joint?.a, joint?.d, joint?.theta], 4) === null);
  return end < 0 ? list : list.slice(0, end);
}

/// Returns the frame of a joint's axis in the previous link: the transform of the link without the joint's rotation.
export function fixedPart(joint) {
  return multiply(rotationX(joint.alpha), translation([joint.a, 0, isPrismatic(joint) ? 0 : joint.d]));
}

function link(joint, q) {
  const [theta, d] = isPrismatic(joint) ? [joint.theta, joint.d + q] : [joint.theta + q, joint.d];
  const before = multiply(rotationX(joint.alpha), translation([joint.a, 0, 0]));
  return multiply(multiply(before, rotationZ(theta)), translation([0, 0, d]));
}

/// Returns the base and the poses of all links after it, in the frame of `base`.
export function links(joints, q, base = IDENTITY) {
  const poses = [base];
  joints.forEach((joint, index) => poses.push(multiply(poses[index], link(joint, q[index]))));
  return poses;
}

/// Returns positions in the middle of the ranges, for an arm of unknown positions.
export function middle(joints) {
  return joints.map((joint) => {
    const range = numbers(joint.range, 2);
    return range ? (range[0] + range[1]) / 2 : 0;
  });
}

/// Returns the length of an arm when stretched out, in m; positive.
export function reach(joints, tip) {
  const sum = joints.reduce((total, joint) => total + Math.abs(joint.a) + Math.abs(joint.d), 0);
  return Math.max(0.05, sum + (tip ? Math.hypot(tip[12], tip[13], tip[14]) : 0));
}
