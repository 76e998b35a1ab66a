// Hand controller, in {0}: its links, the handle at the grip, the floor, and the reflected wrench.

import { armMeshes, radius, rodMesh } from "./arm.js";
import { arrow, wrench } from "./arrows.js";
import { AXES } from "./colours.js";
import { isPrismatic, links, middle, reach, sound } from "./kinematics.js";
import { IDENTITY, fromPose, multiply, numbers, origin, stretch, translation } from "./linear.js";
import { Mesh, SHADOW_SIDES, grid } from "./shapes.js";

/// Length of the arrow of 1 N, in m.
export const METRES_PER_NEWTON = 0.04;

export class HandScene {
  constructor() {
    this.arrowName = "felt";
    this.floor = 0;
    this.describe(null);
  }

  describe(hand) {
    this.joints = sound(hand?.joints);
    this.x_6_g = fromPose(hand?.x_6_g) ?? IDENTITY;
    this.reach = reach(this.joints, this.x_6_g);
    this.arrowRadius = this.reach * 0.011;
    this.floor = -0.24 * this.reach;
    this.acting = null;
    this.move({ q: middle(this.joints) });
    this.hasPosture = false;
  }

  move(snapshot) {
    const q = numbers(snapshot.q, this.joints.length);
    if (q && this.joints.length > 0) {
      this.hasPosture = true;
      this.q = q;
      this.poses = links(this.joints, q);
      this.x_0_g = multiply(this.poses.at(-1), this.x_6_g);
    }
    this.acting = wrench(snapshot.f_g);
  }

  build(painter, colours) {
    if (this.joints.length === 0) return null;
    const meshes = armMeshes(this.joints, this.reach, this.x_6_g, this.floor, colours);
    const shadows = armMeshes(this.joints, this.reach, this.x_6_g, this.floor, colours, SHADOW_SIDES).map((mesh) => painter.upload(mesh));
    const handle = new Mesh();
    const [half, thickness] = [0.055, 0.0155];
    handle.cylinder([0, -half, 0], [0, half, 0], thickness, colours.grip);
    for (const end of [-half, half]) handle.sphere([0, end, 0], thickness * 1.12, colours.grip);
    handle.axes(IDENTITY, this.reach * 0.12, AXES);
    const links = meshes.map((mesh) => painter.upload(mesh));
    const rods = this.joints.map((joint, index) => (isPrismatic(joint) ? painter.upload(rodMesh(radius(this.reach, index, this.joints.length), colours)) : null));
    const axes = painter.upload(new Mesh().axes(translation([0, 0, this.floor]), this.reach * 0.2, AXES));
    const parts = { links, shadows, rods, axes, handle: painter.upload(handle), grid: painter.upload(grid([0, 0], this.reach * 1.5, this.reach > 0.6 ? 0.1 : 0.05, this.floor)) };
    return { ...parts, owned: [...links, ...shadows, ...rods.filter(Boolean), axes, parts.handle, parts.grid] };
  }

  shadows(parts) {
    const bodies = parts.shadows.map((part, index) => ({ part, matrix: this.poses[index] }));
    return [...bodies, { part: parts.handle, matrix: this.x_0_g }];
  }

  solids(parts) {
    const bodies = parts.links.map((part, index) => ({ part, matrix: this.poses[index] }));
    parts.rods.forEach((part, index) => {
      const size = this.joints[index].d + (this.q?.[index] ?? 0);
      if (part && Math.abs(size) > 1e-6) bodies.push({ part, matrix: multiply(this.poses[index + 1], stretch(1, 1, size)) });
    });
    return [...bodies, { part: parts.handle, matrix: this.x_0_g }];
  }

  fixed(parts) {
    return [{ part: parts.axes, matrix: null }];
  }

  lines() {
    return [];
  }

  sheets() {
    return [];
  }

  arrow() {
    return this.hasPosture ? arrow(this.x_0_g, this.acting, METRES_PER_NEWTON) : null;
  }

  markers() {
    if (!this.hasPosture) return [];
    return [...this.joints.map((_, index) => [`joint-${index + 1}`, origin(this.poses[index + 1])]), ["grip", origin(this.x_0_g)]];
  }

  /// Returns the points that the picture must contain: the present posture of the arm, and its base.
  points() {
    if (this.joints.length === 0) return [];
    const base = this.reach * 0.16;
    const foot = [[base, base], [-base, base], [base, -base], [-base, -base]].map(([x, y]) => [x, y, this.floor]);
    const tip = origin(this.x_0_g);
    const room = this.reach * 0.2;
    return [...foot, ...this.poses.map(origin), ...[[room, 0, 0], [-room, 0, 0], [0, room, 0], [0, -room, 0], [0, 0, room], [0, 0, -room]].map((off) => off.map((part, axis) => part + tip[axis]))];
  }
}
