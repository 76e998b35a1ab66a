// Bodies of an arm: joints as cylinders along their axes, links between them as tubes. Each body lies in the frame of its link.

import { fixedPart, isPrismatic } from "./kinematics.js";
import { IDENTITY, add, moved, origin, scale, turned } from "./linear.js";
import { Mesh } from "./shapes.js";

/// Returns the radius of link `index` of `count`, for an arm of this reach: thinner to the tip.
export function radius(reach, index, count) {
  return reach * (0.036 - (0.02 * index) / Math.max(1, count));
}

/// Returns a mesh for the base and each link. `floor` is the height of the ground in the base, `tip` the load of the last link.
export function armMeshes(joints, reach, tip, floor, colours, sides) {
  const meshes = [null, ...joints].map(() => new Mesh(sides));
  meshes.forEach((mesh, index) => {
    const thickness = radius(reach, index, joints.length);
    if (index === 0) base(mesh, thickness, floor, colours);
    else mesh.sphere([0, 0, 0], 1.12 * thickness, colours.link);
    const next = joints[index];
    if (next) {
      tube(mesh, thickness * 0.86, fixedPart(next), next.a, colours);
      housing(mesh, fixedPart(next), radius(reach, index + 1, joints.length), next, colours);
    } else if (tip) {
      mesh.cylinder([0, 0, 0], origin(tip), thickness * 0.7, colours.link);
    }
    // A mark on the axis shows the rotation of the joint.
    if (index > 0) mark(mesh, radius(reach, index, joints.length), colours);
  });
  return meshes;
}

/// Returns the rod of a prismatic joint, a metre long, back along its z.
export function rodMesh(thickness, colours) {
  return new Mesh().cylinder([0, 0, -1], [0, 0, 0], thickness * 0.6, colours.rod);
}

function base(mesh, thickness, floor, colours) {
  mesh.cylinder([0, 0, floor], [0, 0, floor + 0.5 * thickness], 3.2 * thickness, colours.base);
  mesh.cylinder([0, 0, floor], [0, 0, 0], 1.35 * thickness, colours.base);
}

function tube(mesh, thickness, end, a, colours) {
  const knee = [a, 0, 0];
  const to = origin(end);
  mesh.cylinder([0, 0, 0], knee, thickness, colours.link);
  if (Math.abs(a) > 1e-6) mesh.sphere(knee, thickness, colours.link);
  mesh.cylinder(knee, to, thickness, colours.link);
}

function housing(mesh, frame, thickness, joint, colours) {
  const along = turned(frame, [0, 0, 1]);
  const centre = origin(frame);
  const half = scale(along, 1.95 * thickness);
  if (isPrismatic(joint)) mesh.box([1.5 * thickness, 1.5 * thickness, 1.95 * thickness], colours.joint, frame);
  else mesh.cylinder(add(centre, scale(half, -1)), add(centre, half), 1.5 * thickness, colours.joint);
}

function mark(mesh, thickness, colours) {
  for (const side of [-1, 1]) {
    const [near, far] = [1.9 * thickness * side, 2.12 * thickness * side];
    mesh.cylinder([0, 0, near], [0, 0, far], 1.15 * thickness, colours.cap);
    mesh.box([0.5 * thickness, 0.13 * thickness, 0.05 * thickness], colours.link, at([0.6 * thickness, 0, far]));
  }
}

function at(point) {
  const frame = IDENTITY.slice();
  moved(IDENTITY, point).forEach((part, axis) => {
    frame[12 + axis] = part;
  });
  return frame;
}
