// Commanded side, in {b}: robot, object or pegs, their surroundings, and the sensed wrench.

import { armMeshes } from "./arm.js";
import { arrow, wrench } from "./arrows.js";
import { AXES } from "./colours.js";
import { links, reach, sound } from "./kinematics.js";
import { IDENTITY, add, dot, fromPose, moved, multiply, numbers, origin, scale, subtract, translation, unit } from "./linear.js";
import { Mesh, SHADOW_SIDES, grid, panel } from "./shapes.js";

/// Length of the arrow of 1 N, in m.
export const METRES_PER_NEWTON = 0.02;

const isPositive = (value) => Number.isFinite(value) && value > 0;

export class RobotScene {
  constructor() {
    this.arrowName = "sensed";
    this.floor = 0;
    this.describe(null);
  }

  describe(description) {
    const robot = description?.robot;
    this.joints = sound(robot?.joints);
    this.x_b_0 = fromPose(robot?.x_b_0) ?? IDENTITY;
    this.x_n_m = fromPose(robot?.x_n_m) ?? IDENTITY;
    this.x_m_s = fromPose(description?.x_m_s) ?? IDENTITY;
    this.tool = description?.tool ?? null;
    this.environment = description?.scene ?? {};
    this.hasRobot = this.joints.length > 0;
    this.reach = this.hasRobot ? reach(this.joints, this.x_n_m) : 0.5;
    this.arrowRadius = this.hasRobot ? this.reach * 0.0085 : 0.0055;
    [this.poses, this.x_b_m, this.acting, this.start] = [null, null, null, null];
    this.floor = this.hasRobot ? origin(this.x_b_0)[2] : 0;
  }

  move(snapshot) {
    const q = this.hasRobot ? numbers(snapshot.q_r, this.joints.length) : null;
    this.poses = q && links(this.joints, q, this.x_b_0);
    this.x_b_m = fromPose(snapshot.x_b_m);
    this.acting = wrench(snapshot.f_s);
    // Floor and wall are unbounded: they are drawn around the first position of the object.
    if (!this.start && this.x_b_m) {
      this.start = origin(this.x_b_m);
      this.isMoved = true;
    }
  }

  build(painter, colours) {
    const centre = this.start ?? [0.4, 0, 0.3];
    if (!this.hasRobot) this.floor = this.lowest(centre);
    const owned = [];
    const upload = (mesh) => {
      const part = painter.upload(mesh);
      owned.push(part);
      return part;
    };
    const parts = { owned, links: [], shadows: [], lines: [], sheets: [] };
    if (this.hasRobot) {
      parts.links = armMeshes(this.joints, this.reach, this.x_n_m, 0, colours).map(upload);
      parts.shadows = armMeshes(this.joints, this.reach, this.x_n_m, 0, colours, SHADOW_SIDES).map(upload);
    }
    parts.tool = upload(toolMesh(this.tool, colours));
    const middle = this.hasRobot ? scale(add(origin(this.x_b_0), centre), 0.5) : centre;
    parts.grid = upload(grid(middle, this.hasRobot ? this.reach * 1.1 : 0.5, this.hasRobot ? 0.1 : 0.05, this.floor));
    parts.solid = upload(this.solidMesh(colours));
    const { wall } = this.environment;
    const [point, normal] = [numbers(wall?.point, 3), numbers(wall?.normal, 3)];
    if (point && normal) {
      const n = unit(normal);
      const foot = subtract(centre, scale(n, dot(subtract(centre, point), n)));
      const { sheet, hatching } = panel(foot, n, this.panelHalf, colours.wall);
      parts.sheets.push(upload(sheet));
      parts.lines.push(upload(hatching));
    }
    this.hatchingColour = colours.hatching;
    return parts;
  }

  get panelHalf() {
    return this.hasRobot ? this.reach * 0.22 : 0.16;
  }

  /// Returns a height below the object and its surroundings.
  lowest(centre) {
    const { box, sphere, plate } = this.environment;
    const heights = [centre[2], numbers(box?.centre, 3)?.[2] - box?.half_size?.[2], numbers(sphere?.centre, 3)?.[2] - sphere?.radius, numbers(plate?.x_b_p?.position, 3)?.[2]];
    return Math.min(...heights.filter(Number.isFinite)) - 0.16;
  }

  solidMesh(colours) {
    const mesh = new Mesh();
    const { box, sphere, plate } = this.environment;
    const [centre, half] = [numbers(box?.centre, 3), numbers(box?.half_size, 3)];
    if (centre && half) mesh.box(half, colours.solid, translation(centre));
    if (numbers(sphere?.centre, 3) && isPositive(sphere.radius)) mesh.sphere(sphere.centre, sphere.radius, colours.solid);
    const [x_b_p, size] = [fromPose(plate?.x_b_p), numbers(plate?.half_size, 2)];
    if (x_b_p && size && isPositive(plate.thickness)) {
      const count = isPositive(plate.hole_radius) ? Math.min(8, Math.max(0, Math.round(plate.hole_count) || 0)) : 0;
      const centres = Array.from({ length: count }, (_, k) => (k - (count - 1) / 2) * (plate.hole_spacing || 0));
      mesh.plate(x_b_p, size, plate.thickness, centres, plate.hole_radius, colours.solid);
    }
    return mesh.axes(IDENTITY, 0.08, AXES);
  }

  shadows(parts) {
    return this.bodies(parts, parts.shadows);
  }

  solids(parts) {
    return this.bodies(parts, parts.links);
  }

  bodies(parts, links) {
    const bodies = this.poses ? links.map((part, index) => ({ part, matrix: this.poses[index] })) : [];
    if (this.x_b_m) bodies.push({ part: parts.tool, matrix: this.x_b_m });
    return bodies;
  }

  fixed(parts) {
    return [{ part: parts.solid, matrix: null }];
  }

  lines(parts) {
    return parts.lines.map((part) => ({ part, flat: this.hatchingColour }));
  }

  sheets(parts) {
    return parts.sheets.map((part) => ({ part, opacity: 0.3 }));
  }

  arrow() {
    return this.x_b_m ? arrow(multiply(this.x_b_m, this.x_m_s), this.acting, METRES_PER_NEWTON) : null;
  }

  markers() {
    const joints = (this.poses ?? []).slice(1).map((pose, index) => [`joint-${index + 1}`, origin(pose)]);
    return this.x_b_m ? [...joints, ["mrf", origin(this.x_b_m)]] : joints;
  }

  points() {
    if (!this.x_b_m) return [];
    const { box, sphere, plate } = this.environment;
    const near = [origin(this.x_b_m), numbers(box?.centre, 3), numbers(sphere?.centre, 3), numbers(plate?.x_b_p?.position, 3)].filter(Boolean);
    const room = this.hasRobot ? this.reach * 0.12 : 0.13;
    const around = near.flatMap((point) => [-room, room].flatMap((off) => [0, 1, 2].map((axis) => point.map((part, k) => part + (k === axis ? off : 0)))));
    if (!this.hasRobot) return around;
    const foot = 0.13 * this.reach;
    const base = [[foot, foot], [-foot, foot], [foot, -foot], [-foot, -foot]].map(([x, y]) => moved(this.x_b_0, [x, y, 0]));
    return [...around, ...base, ...(this.poses ?? []).map(origin)];
  }
}

function toolMesh(tool, colours) {
  const mesh = new Mesh();
  if (tool?.kind === "cube" && isPositive(tool.half_edge)) {
    const half = tool.half_edge;
    return mesh.box([half, half, half], colours.tool).axes(IDENTITY, Math.max(0.06, 2.4 * half), AXES);
  }
  const x_m_t = tool?.kind === "pegs" ? fromPose(tool.x_m_t) : null;
  if (x_m_t && isPositive(tool.radius) && isPositive(tool.length)) {
    const count = Math.min(8, Math.max(1, Math.round(tool.count) || 1));
    const spread = ((count - 1) / 2) * (tool.spacing || 0);
    for (let k = 0; k < count; k += 1) {
      const x = k * (tool.spacing || 0) - spread;
      mesh.cylinder(moved(x_m_t, [x, 0, 0]), moved(x_m_t, [x, 0, tool.length]), tool.radius, colours.tool);
    }
    const half = [spread + 1.5 * tool.radius, 1.5 * tool.radius, 0.5 * tool.radius];
    const plate = x_m_t.slice();
    moved(x_m_t, [0, 0, -half[2]]).forEach((part, axis) => {
      plate[12 + axis] = part;
    });
    return mesh.box(half, colours.rig, plate).axes(IDENTITY, 0.06, AXES);
  }
  // For a tool that only the far side knows: its position.
  return mesh.sphere([0, 0, 0], 0.012, colours.tool).axes(IDENTITY, 0.07, AXES);
}
