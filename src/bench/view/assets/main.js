// The page: passes the data of the feed to views, charts and panels, each at its own rate.

import { settings } from "./address.js";
import { Banner } from "./banner.js";
import { Charts } from "./charts.js";
import { palette } from "./colours.js";
import { attach, attachSwitch } from "./controls.js";
import { charts, row, WIDTH } from "./curves.js";
import { read } from "./feed.js";
import { HandScene } from "./hand_scene.js";
import { History } from "./history.js";
import { JointsPanel } from "./joints_panel.js";
import { NodePanel } from "./node_panel.js";
import { RobotScene } from "./robot_scene.js";
import { Stage } from "./stage.js";
import { name, plain, setHidden, setText } from "./text.js";
import { placeLabel, tellWrench } from "./wrench_text.js";

const PANEL_INTERVAL_MS = 120;
const AWAY_AFTER_MS = 1000;
const NO_WEBGL = "This browser has no WebGL, or it is switched off: the arm cannot be drawn. All numbers and charts are here.";

const at = (id) => document.getElementById(id);
const given = settings();
const banner = new Banner();
const history = new History(WIDTH);
const hand = { scene: new HandScene(), id: "hand", stated: given.hand };
const robot = { scene: new RobotScene(), id: "robot", stated: given.robot, direction: { yaw: -1.9, pitch: 0.36 } };
const views = [hand, robot];
const shown = { description: null, snapshot: null, isNew: false, isPaused: false, isFitted: false };
const clock = { arrived: null, started: performance.now(), reason: null, isAbsent: false, panels: 0, pictures: 0, since: performance.now() };
let panels = null;
let strips = null;
let colours = null;

for (const view of views) {
  view.canvas = at(`${view.id}-view`);
  view.stage = new Stage(view.canvas, view.scene, view.direction);
  view.label = at(`${view.id}-label`);
  view.stage.markers = given.markers;
  const { eye, target } = view.stated;
  if (eye && target) view.stage.camera.state(eye, target);
  if (!view.stage.painter) {
    setText(at(`${view.id}-absent`), NO_WEBGL);
    setHidden(at(`${view.id}-absent`), false);
    setHidden(view.canvas, true);
    setHidden(at(`${view.id}-buttons`), true);
  } else {
    attach(view.canvas, view.stage.camera, at(`${view.id}-buttons`));
  }
}

attachSwitch(at("markers-button"), "m", () => {
  const isOn = !hand.stage.markers;
  for (const view of views) {
    view.stage.markers = isOn ? new Set() : null;
    view.stage.needsPicture = true;
  }
  return isOn;
});
attachSwitch(at("pause-button"), "p", () => {
  shown.isPaused = !shown.isPaused;
  setText(at("pause-button"), shown.isPaused ? "Paused" : "Pause");
  return shown.isPaused;
});
at("markers-button").setAttribute("aria-pressed", String(given.markers !== null));

const prefersDark = window.matchMedia("(prefers-color-scheme: dark)");
prefersDark.addEventListener("change", applyTheme);
applyTheme();

function applyTheme() {
  const theme = given.theme ?? (prefersDark.matches ? "dark" : "light");
  document.documentElement.dataset.theme = theme;
  const style = getComputedStyle(document.documentElement);
  colours = { theme, ...Object.fromEntries(["ink", "soft", "line"].map((key) => [key, style.getPropertyValue(`--${key}`).trim()])) };
  for (const view of views) view.stage.rebuild(palette(theme));
  strips?.drawAll(seconds(), colours);
}

function seconds() {
  return performance.now() / 1000;
}

/// Shows errors of a line in the page, not only in the console.
function guarded(work) {
  try {
    work();
  } catch (error) {
    setText(at("fault"), `This page cannot show a line of the node: ${error}`);
    setHidden(at("fault"), false);
  }
}

function onEvent(kind, text) {
  guarded(() => {
    const line = JSON.parse(text);
    if (line === null || typeof line !== "object") return;
    if (kind === "absent") {
      clock.reason = plain(line.reason);
      clock.isAbsent = true;
      shown.isCut = true;
      return;
    }
    clock.arrived = performance.now();
    clock.isAbsent = false;
    if (kind === "description") describe(line, text);
    else if (kind === "mode") banner.update(line);
    else if (kind === "snapshot") take(line);
  });
}

function onLost(reason) {
  clock.reason = reason;
  clock.isAbsent = true;
  shown.isCut = true;
}

/// Returns the part of a description that defines the picture: the camera does not move while it is unchanged.
const geometry = ({ hand: arm, robot: slave, tool, scene, x_m_s }) => JSON.stringify([arm, slave, tool, scene, x_m_s]);

function describe(description) {
  const isSame = shown.description && geometry(shown.description) === geometry(description);
  shown.description = description;
  shown.isCut = true;
  banner.forget();
  if (!isSame) {
    hand.scene.describe(description.hand);
    robot.scene.describe(description);
    shown.isFitted = false;
    for (const view of views) {
      view.stage.camera.fit(view.scene.points());
      view.stage.rebuild(palette(colours.theme));
    }
  }
  const joints = Array.isArray(description.hand?.joints) ? description.hand.joints.slice(0, 9) : [];
  panels = [new JointsPanel(joints, description.stops_by), new NodePanel(description)];
  strips = new Charts(at("charts"), charts(joints.map((joint) => name(joint?.name))), history);
  const facts = [description.program, description.source, description.configuration].filter((fact) => typeof fact === "string").map(name);
  setText(at("source"), facts.length > 0 ? facts.join(" · ") : "A running node, to look at.");
  setText(at("hand-note"), `in {0} · ${joints.length} joints`);
  const slave = description.robot;
  setText(at("robot-note"), slave ? `in {b} · ${name(slave.name)}, ${Array.isArray(slave.joints) ? slave.joints.length : "–"} joints` : "in {b} · virtual object");
}

function take(snapshot) {
  banner.update(snapshot);
  history.push(seconds(), row(snapshot), shown.isCut === true);
  shown.isCut = false;
  if (shown.isPaused && shown.isFitted) return;
  shown.snapshot = snapshot;
  shown.isNew = true;
  for (const view of views) view.scene.move(snapshot);
}

/// Draws once for each new snapshot or camera; panels and charts less often.
function picture() {
  requestAnimationFrame(picture);
  guarded(() => {
    const now = performance.now();
    const isDrawn = shown.isNew && draw();
    const isMoved = views.some(({ stage }) => stage.needsPicture || stage.camera.isChanged);
    if (!isDrawn && isMoved && shown.snapshot) draw();
    if (!shown.isPaused && strips && (isDrawn || clock.isAbsent)) strips.drawNext(now / 1000, colours);
    if (now - clock.panels >= PANEL_INTERVAL_MS) {
      clock.panels = now;
      showPanels(now);
    }
  });
}

function draw() {
  const first = !shown.isFitted;
  if (first && shown.snapshot && shown.description) fit();
  for (const view of views) {
    view.stage.draw();
    placeLabel(view);
  }
  if (shown.isNew) countPicture();
  shown.isNew = false;
  return true;
}

/// Fits both cameras to the first state of arm and scene; only the user moves them afterwards.
function fit() {
  shown.isFitted = true;
  for (const view of views) {
    view.stage.resize();
    view.stage.camera.fit(view.scene.points());
    if (view.scene.isMoved) view.stage.rebuild(palette(colours.theme));
  }
}

function countPicture() {
  const now = performance.now();
  const { dataset } = document.documentElement;
  dataset.first_picture_ms ??= String(Math.round(now));
  dataset.age_ms = (now - clock.arrived).toFixed(1);
  const begun = Date.parse(shown.description?.started_at ?? "");
  if (Number.isFinite(begun)) dataset.feed_age_ms = (Date.now() - begun - shown.snapshot.at_us / 1000).toFixed(1);
  dataset.cycle = String(shown.snapshot.cycle);
  clock.pictures += 1;
  if (now - clock.since >= 1000) {
    dataset.fps = ((1000 * clock.pictures) / (now - clock.since)).toFixed(1);
    [clock.pictures, clock.since] = [0, now];
  }
}

function showPanels(now) {
  const age = now - (clock.arrived ?? clock.started);
  const isAway = age > AWAY_AFTER_MS || (clock.isAbsent && clock.arrived === null);
  document.documentElement.classList.toggle("is-away", isAway);
  banner.show(isAway ? age / 1000 : null, clock.isAbsent ? clock.reason : "The node sends nothing; the connection is up.");
  const { dataset } = document.documentElement;
  if (isAway && clock.pictures === 0 && now - clock.since > 1500) dataset.fps = "0";
  const drawn = isAway ? "no pictures: no data" : `${dataset.fps ?? "–"} pictures a second, newest snapshot drawn ${dataset.age_ms ?? "–"} ms after it came`;
  setText(at("figures"), shown.isPaused ? "paused" : drawn);
  if (shown.isPaused || !shown.snapshot || !panels) return;
  for (const panel of panels) panel.show(shown.snapshot);
  for (const view of views) {
    // The text may be due without a new picture.
    placeLabel(view);
    tellWrench(view);
  }
}

read(onEvent, onLost);
requestAnimationFrame(picture);
