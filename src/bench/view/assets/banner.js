// Banner: mode, cause and the steps to leave it, or the reason for missing data. Colour, sign and words are equivalent.

import { make, name, plain, setHidden, setText } from "./text.js";

const SIGNS = {
  circle: "M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18M8.5 12h7",
  ready: "M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18M8 12.3l2.8 2.8L16.2 9.4",
  play: "M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18M10 8.5v7l5.5-3.5z",
  hand: "M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18M12 7.5v5M12 16.3v.2",
  boot: "M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18M12 7v5l3.5 2",
  stop: "M8 3h8l5 5v8l-5 5H8l-5-5V8zM9 9l6 6M15 9l-6 6",
  away: "M4 4l16 16M8 8.2A9 9 0 0 0 4.5 11M12 7a10 10 0 0 1 7.5 4M9 15a4.5 4.5 0 0 1 4.5-1.1M12 18.8v.2",
};

const MODES = {
  boot: ["calm", "boot", "Boot", "The drives are brought up and prove that they stop."],
  ready: ["calm", "ready", "Ready", "The drives are enabled. Nothing pushes."],
  armed: ["calm", "hand", "Armed", "Gravity compensation carries the arm. The deadman engages."],
  engaged: ["fine", "play", "Engaged", "The grip commands, and what is sensed is felt."],
  measuring: ["fine", "play", "Measuring", "While the deadman is held the arm moves by itself. Nothing is commanded and nothing felt."],
  "reflection-off": ["warn", "stop", "Reflection off", "Nothing is felt or commanded any more; gravity compensation carries the arm."],
  "zero-torque": ["stop", "stop", "Zero torque", "All torques are zero; the drives are about to be disabled. Hold the arm."],
  "drives-off": ["stop", "stop", "Drives off", "All torques are zero, and voltage is disabled. The arm falls unless it is held."],
};

const CONNECTING = ["away", "Connecting", "Waiting for the first line of the node."];

export class Banner {
  constructor() {
    const at = (id) => document.getElementById(id);
    [this.banner, this.icon, this.mode, this.text] = [at("banner"), at("mode-icon").firstElementChild, at("mode"), at("mode-text")];
    [this.cause, this.notOff, this.steps, this.title, this.list] = [at("cause"), at("not-off"), at("steps"), at("steps-title"), at("way-out")];
    this.line = null;
    this.reason = null;
    this.shownSteps = "";
  }

  /// Stores a line of kind `mode`, or the newer mode and cause of a snapshot.
  update(line) {
    const isSame = this.line?.mode === line.mode && this.line?.stopped_by === line.stopped_by;
    // A snapshot has joint numbers and no steps: those of the mode line remain until the mode changes.
    if (line.kind === "mode") this.line = line;
    else if (!isSame) this.line = { mode: line.mode, stopped_by: line.stopped_by, not_off: [], way_out: [] };
  }

  forget() {
    this.line = null;
  }

  /// Shows the mode, or the time without data in seconds and its reason.
  show(awaySeconds, reason) {
    const isAway = awaySeconds !== null;
    const line = isAway ? null : this.line;
    if (isAway) {
      const since = this.line || awaySeconds >= 1 ? `No data since ${Math.floor(awaySeconds)}\u202fs` : "No data";
      this.head("absent", "away", since, reason ?? CONNECTING[2]);
    } else if (!line) {
      this.head("absent", "away", CONNECTING[1], CONNECTING[2]);
    } else {
      const [tone, sign, title, text] = MODES[line.mode] ?? ["warn", "circle", name(line.mode), "This page does not know that mode."];
      this.head(tone, sign, title, text);
    }
    this.setCause(line, isAway);
    this.setSteps(line);
  }

  head(tone, sign, title, text) {
    if (this.banner.className !== tone) this.banner.className = tone;
    if (this.icon.getAttribute("d") !== SIGNS[sign]) this.icon.setAttribute("d", SIGNS[sign]);
    setText(this.mode, title);
    setText(this.text, plain(text));
  }

  setCause(line, isAway) {
    const cause = line?.stopped_by ?? null;
    setHidden(this.cause, cause === null);
    if (cause !== null) setText(this.cause, `Stopped by ${plain(cause)}`);
    const names = Array.isArray(line?.not_off) ? line.not_off.map(name) : [];
    setHidden(this.notOff, isAway || names.length === 0);
    if (names.length > 0) {
      const [drives, report] = names.length === 1 ? ["drive", "does not report that it is"] : ["drives", "do not report that they are"];
      setText(this.notOff, `Do not touch the arm: the ${drives} of ${names.join(", ")} ${report} off.`);
    }
  }

  setSteps(line) {
    const steps = Array.isArray(line?.way_out) ? line.way_out.slice(0, 20) : [];
    setHidden(this.steps, steps.length === 0);
    const key = JSON.stringify(steps);
    if (key === this.shownSteps) return;
    this.shownSteps = key;
    this.list.replaceChildren(...steps.map(item));
    setText(this.title, line?.stopped_by ? "How to leave this state" : "What leads on");
  }
}

/// Returns a step as a list item; text between backquotes is a command.
function item(step) {
  const element = make("li");
  element.append(...plain(step).split("`").map((text, place) => (place % 2 ? make("code", "", text) : text)));
  return element;
}
