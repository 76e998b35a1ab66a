// The node itself: facts, losses, timing, buses, link and watchdogs.

import { BarList } from "./bar.js";
import { count, make, name, number, plain, quantity, setHidden, setText } from "./text.js";

const TIMES = [
  ["wake_up_late_us", "Wake-up after SYNC was due"], ["sync_to_last_sample_us", "SYNC to the last sample"], ["step_us", "Watches and controller"],
  ["sync_to_last_target_us", "SYNC to the last target"], ["sync_to_confirmation_us", "SYNC to its confirmation"],
];

const LOSSES = [
  ["overruns", "cycles over time"], ["missing_samples", "missed samples"], ["foreign_uploads", "SDO uploads of other clients"],
  ["unread_settings", "settings that could not be read again"],
];
const LOST = { frames: "frames", records: "records", inputs: "inputs", events: "events", of_session: "entries of the session", of_faults: "entries of fault records" };

/// Rows of names and values; a row appears when it is first set.
class Facts {
  constructor(list) {
    this.list = list;
    this.values = new Map();
  }

  set(label, text) {
    if (!this.values.has(label)) {
      const group = this.list.appendChild(make("div"));
      group.append(make("dt", "", label));
      this.values.set(label, group.appendChild(make("dd")));
    }
    setText(this.values.get(label), text);
  }

  clear() {
    this.list.replaceChildren();
    this.values.clear();
  }
}

/// Returns the scales other than 1, the locked axes and an alignment under way.
function adjusted({ scale, locked, aligning }) {
  const factors = ["motion", "rotation", "force"].filter((quantity) => Number.isFinite(scale?.[quantity]) && scale[quantity] !== 1);
  const parts = factors.map((quantity) => `${quantity} × ${number(scale[quantity], 2)}`);
  if (Array.isArray(locked)) parts.push(...locked.slice(0, 6).map((axis) => `${name(axis)} locked`));
  if (aligning === true) parts.push("aligning");
  return parts.length > 0 ? parts.join(", ") : "as configured";
}

export class NodePanel {
  constructor(description) {
    const at = (id) => document.getElementById(id);
    this.period = description.period_us;
    this.described = Array.isArray(description.buses) ? description.buses.slice(0, 8) : [];
    [this.facts, this.link] = [new Facts(at("facts")), new Facts(at("link"))];
    this.facts.clear();
    this.link.clear();
    [this.losses, this.timingNote] = [at("losses"), at("timing-note")];
    [this.timing, this.buses, this.watchdogs] = [new BarList(at("timing")), new BarList(at("buses")), new BarList(at("watchdogs"))];
    for (const id of ["timing", "buses", "watchdogs"]) at(id).replaceChildren();
  }

  show(snapshot) {
    const { facts } = this;
    facts.set("Time", quantity(snapshot.at_us / 1e6, 2, "s"));
    facts.set("Cycle", count(snapshot.cycle));
    facts.set("Reflection", plain(snapshot.reflection));
    facts.set("Command", commanded(snapshot.command));
    facts.set("Adjusted", adjusted(snapshot));
    if (snapshot.gripper) facts.set("Gripper", gripped(snapshot.gripper));
    facts.set("Switch box", snapshot.switches_online === null ? "not configured" : snapshot.switches_online ? "online" : "offline");
    facts.set("Dampers active", quantity(100 * snapshot.activity, 0, "%"));
    if (snapshot.recording) facts.set("Recording", recorded(snapshot.recording));
    this.showLosses(snapshot);
    this.showTiming(snapshot.timing);
    this.showBuses(snapshot.buses);
    this.showLink(snapshot);
    this.showWatchdogs(snapshot.watchdogs);
  }

  showLosses(snapshot) {
    const found = LOSSES.map(([key, label]) => [snapshot[key], label]);
    for (const [key, label] of Object.entries(LOST)) found.push([snapshot.lost?.[key], `${label} lost before the disk`]);
    const text = found.filter(([value]) => value > 0).map(([value, label]) => `${count(value)} ${label}`).join(" · ");
    setHidden(this.losses, text === "");
    setText(this.losses, text);
  }

  showTiming(timing) {
    const known = TIMES.filter(([key]) => timing?.[key]?.count > 0);
    const period = this.period;
    const one = Number.isFinite(period) ? `Of a cycle of ${count(period)}\u202fµs. ` : "";
    setText(this.timingNote, known.length > 0 ? `${one}Bar: 99th percentile; marks: median and maximum.` : "The node reports no times yet.");
    const bars = this.timing.match(known.map(([, label]) => label));
    known.forEach(([key], index) => {
      const { p50, p99, max } = timing[key];
      bars[index].set(`${count(p50)} · ${count(p99)} · ${count(max)}\u202fµs`, p99 / period);
      bars[index].bar.mark(p50 / period, max / period);
    });
  }

  showBuses(buses) {
    const bars = this.buses.match(this.described.map((bus) => name(bus?.name)));
    this.described.forEach((bus, index) => {
      const [load, limit] = [buses?.[index]?.load_percent, bus?.load_limit_percent];
      const rate = quantity(buses?.[index]?.frames_per_s, 0, "frames/s");
      bars[index].set(`${quantity(load, 1, "%")} of at most ${quantity(limit, 0, "%")} · ${rate}`, load / 100, limit / 100);
      bars[index].bar.mark(limit / 100);
    });
  }

  showLink({ sample_age_us: age, model, link }) {
    this.link.set("Age of the sample", quantity(age / 1000, 1, "ms"));
    if (model) this.link.set("Robot to its model", `${quantity(model.distance_mm, 1, "mm")}, ${quantity(model.angle_deg, 1, "°")}`);
    if (!link) return;
    this.link.set("Far side", link.connected ? plain(link.far_side ?? "connected") : "not connected");
    this.link.set("Round trip, median", quantity(link.round_trip_p50_ms, 1, "ms"));
    this.link.set("Round trip, 99 %", quantity(link.round_trip_p99_ms, 1, "ms"));
    this.link.set("Led by", plain(link.leader));
    this.link.set("Messages lost", count(link.lost));
    this.link.set("Commands dropped", count(link.dropped));
  }

  showWatchdogs(watchdogs) {
    const list = Array.isArray(watchdogs) ? watchdogs.slice(0, 40).filter((watchdog) => watchdog) : [];
    const bars = this.watchdogs.match(list.map((watchdog) => name(watchdog.name)));
    list.forEach(({ value, limit, unit }, index) => {
      const digits = Number.isInteger(value) && Number.isInteger(limit) ? 0 : Math.abs(limit) < 10 ? 2 : 1;
      bars[index].set(`${number(value, digits)} of ${number(limit, digits)}\u202f${plain(unit ?? "").slice(0, 16)}`, value / limit);
    });
  }
}

function commanded(command) {
  if (command?.kind === "rate") {
    const v = command.v_m;
    return Array.isArray(v) && v.slice(0, 3).every(Number.isFinite) ? `rate ${quantity(1000 * Math.hypot(v[0], v[1], v[2]), 0, "mm/s")}` : "rate –";
  }
  return plain(command?.kind);
}

/// Returns opening and force of the gripper, each beside its command.
function gripped({ state, commanded_m: commanded, max_force_n: most, opening_m: opening, force_n: force }) {
  if (!Number.isFinite(opening)) return plain(state);
  const at = `${quantity(1000 * opening, 1, "mm")}, ${quantity(force, 1, "N")}`;
  return Number.isFinite(commanded) ? `${at} · commanded ${quantity(1000 * commanded, 1, "mm")}, at most ${quantity(most, 1, "N")}` : `${at} · ${plain(state)}`;
}

function recorded({ parts, ended_early: ended }) {
  const files = parts === 1 ? "1 part" : `${count(parts)} parts`;
  return ended ? `${files}; ended early: ${plain(ended)}` : files;
}
