// Rows of the history from snapshots, and the charts that show them.

import { length, numbers } from "./linear.js";

const MAX_JOINTS = 9;

/// Columns by name: value, minimum and maximum, side by side.
const NAMES = ["s_x", "s_y", "s_z", "t_x", "t_y", "t_z", "v"];
const PLAIN = ["energy", "tank", "age", ...Array.from({ length: MAX_JOINTS }, (_, joint) => `used_${joint}`)];
const COLUMN = new Map();
for (const name of NAMES) for (const kind of ["", ".min", ".max"]) COLUMN.set(name + kind, COLUMN.size);
for (const name of PLAIN) COLUMN.set(name, COLUMN.size);

export const WIDTH = COLUMN.size;

/// Returns the row of a snapshot.
export function row(snapshot) {
  const values = new Array(WIDTH).fill(NaN);
  const put = (name, value) => {
    if (Number.isFinite(value)) values[COLUMN.get(name)] = value;
  };
  const band = (letter, list, span) => {
    ["x", "y", "z"].forEach((axis, k) => {
      put(`${letter}_${axis}`, list?.[k]);
      put(`${letter}_${axis}.min`, span?.min?.[k] ?? list?.[k]);
      put(`${letter}_${axis}.max`, span?.max?.[k] ?? list?.[k]);
    });
  };
  band("s", snapshot.f_s, snapshot.spans?.f_s);
  band("t", snapshot.f_g_task, snapshot.spans?.f_g_task);
  const [least, greatest] = [numbers(snapshot.spans?.v_g?.min, 3), numbers(snapshot.spans?.v_g?.max, 3)];
  if (least && greatest) {
    // The speed lies between those of the nearest and the farthest corner of the span.
    const far = least.map((low, k) => Math.max(Math.abs(low), Math.abs(greatest[k])));
    const near = least.map((low, k) => (low <= 0 && greatest[k] >= 0 ? 0 : Math.min(Math.abs(low), Math.abs(greatest[k]))));
    put("v", length(least.map((low, k) => (low + greatest[k]) / 2)));
    put("v.min", length(near));
    put("v.max", length(far));
  }
  put("energy", snapshot.energy);
  put("tank", snapshot.tank);
  put("age", snapshot.sample_age_us);
  if (Array.isArray(snapshot.limit_used)) snapshot.limit_used.slice(0, MAX_JOINTS).forEach((share, joint) => put(`used_${joint}`, share));
  return values;
}

const band = (name, label) => ({ label, value: COLUMN.get(name), low: COLUMN.get(`${name}.min`), high: COLUMN.get(`${name}.max`) });
const line = (name, label) => ({ label, value: COLUMN.get(name), low: COLUMN.get(name), high: COLUMN.get(name) });
const axes = (letter) => ["x", "y", "z"].map((axis) => band(`${letter}_${axis}`, axis));

/// Returns the charts: title, unit, factor from SI, digits, minimum height, curves.
export function charts(joints) {
  const names = joints.slice(0, MAX_JOINTS);
  return [
    { title: "Force sensed, in {S}", unit: "N", factor: 1, digits: 2, least: 1, curves: axes("s") },
    { title: "Force reflected, in {G}", unit: "N", factor: 1, digits: 2, least: 0.5, curves: axes("t") },
    { title: "Torque, share of the limit", unit: "%", factor: 100, digits: 0, least: 20, curves: names.map((joint, index) => line(`used_${index}`, joint)) },
    { title: "Speed of the grip", unit: "mm/s", factor: 1000, digits: 0, least: 50, curves: [band("v", "speed")] },
    { title: "Energy at the port", unit: "mJ", factor: 1000, digits: 1, least: 10, curves: [line("energy", "from the hand"), line("tank", "tank")] },
    { title: "Age of the wrench sample", unit: "ms", factor: 1e-3, digits: 1, least: 2, curves: [line("age", "at SYNC")] },
  ];
}

