// Tables by joint: position, torque and share of the limit; and the parts of the torque.

import { Bar } from "./bar.js";
import { numbers } from "./linear.js";
import { make, name, number, plain, setText } from "./text.js";

const PARTS = [
  ["task", "Task"], ["gravity", "Gravity"], ["centring", "Return to centre"], ["damping", "Damping"], ["passivity", "Passivity"],
  ["soft_stops", "Soft stops"], ["friction", "Friction"], ["hold", "Hold"],
];

/// Returns a table header; the first column is for the joints.
function head(table, titles) {
  const row = table.createTHead().insertRow();
  titles.forEach(([title, className]) => {
    const cell = row.appendChild(make("th", className, title));
    cell.scope = "col";
  });
}

function labelled(row, joint) {
  const cell = row.appendChild(make("th"));
  cell.scope = "row";
  const label = cell.appendChild(make("bdi", "", name(joint?.name)));
  label.title = plain(joint?.name).slice(0, 1000);
}

export class JointsPanel {
  constructor(joints, stopsBy) {
    this.joints = joints;
    this.rows = this.makeJoints(document.getElementById("joints"), stopsBy);
    this.budget = this.makeBudget(document.getElementById("budget"));
    this.scales = document.getElementById("scales");
  }

  makeJoints(table, stopsBy) {
    table.replaceChildren();
    head(table, [["Joint", ""], ["Position", "n"], ["", "n"], ["in its range", ""], ["Torque", "n"], ["", "n"], ["share of the limit", ""], ["", "n"], ["Target", "n"], ["Sample", ""]].map(([title, className]) => [title, className]).filter(([title]) => title));
    const body = table.createTBody();
    return this.joints.map((joint, index) => {
      const row = body.insertRow();
      labelled(row, joint);
      const cell = (className) => row.appendChild(make("td", className));
      const found = { position: cell("n"), place: new Bar("place") };
      cell("bar-cell").append(found.place.element);
      found.torque = cell("n");
      found.used = new Bar();
      const used = cell("bar-cell");
      used.append(found.used.element);
      found.target = cell("n quiet");
      found.sample = cell("quiet");
      row.title = typeof stopsBy?.[index] === "string" ? `Stops without the master by ${plain(stopsBy[index]).slice(0, 300)}` : "";
      return found;
    });
  }

  makeBudget(table) {
    table.replaceChildren();
    head(table, [["Joint", ""], ...PARTS.map(([, title]) => [title, "n"]), ["Sent", "n"], ["Unit", ""]]);
    const body = table.createTBody();
    return this.joints.map((joint) => {
      const row = body.insertRow();
      labelled(row, joint);
      const cells = [...PARTS, null].map(() => row.appendChild(make("td", "n")));
      row.append(make("td", "quiet", plain(joint?.torque_unit ?? "N·m").slice(0, 12)));
      return cells;
    });
  }

  show(snapshot) {
    this.joints.forEach((joint, index) => {
      const row = this.rows[index];
      const [q, torque, used] = [snapshot.q?.[index], snapshot.tau?.[index], snapshot.limit_used?.[index]];
      const range = numbers(joint?.range, 2);
      const unknown = Array.isArray(snapshot.zero_unknown) ? snapshot.zero_unknown.find((it) => it?.joint === index + 1) : undefined;
      row.position.title = unknown ? plain(unknown.why).slice(0, 300) : "";
      const goal = snapshot.hold?.to?.[index];
      const shown = Number.isFinite(goal) ? `${number(q, 3)} to ${number(goal, 3)}` : number(q, 3);
      setText(row.position, unknown ? "zero unknown" : Number.isFinite(q) ? `${shown}\u202f${plain(joint?.position_unit ?? "rad").slice(0, 12)}` : shown);
      row.place.mark(range ? (q - range[0]) / (range[1] - range[0]) : NaN);
      setText(row.torque, Number.isFinite(torque) ? `${number(torque, 2)}\u202f${plain(joint?.torque_unit ?? "N·m").slice(0, 12)}` : number(torque, 2));
      row.used.set(used);
      setText(row.target, Number.isFinite(snapshot.targets?.[index]) ? `${number(snapshot.targets[index], 0)}\u202f‰` : number(NaN, 0));
      const isSampled = snapshot.sampled?.[index];
      setText(row.sample, isSampled === true ? "in time" : isSampled === false ? "missing" : "–");
      PARTS.forEach(([part], column) => setText(this.budget[index][column], number(snapshot.budget?.[part]?.[index], 3)));
      setText(this.budget[index][PARTS.length], number(torque, 3));
    });
    const { budget } = snapshot;
    const by = (joint) => (Number.isInteger(joint) ? `, set by ${name(this.joints[joint - 1]?.name ?? joint)}` : "");
    const scale = (value) => (Number.isFinite(value) ? `${number(100 * value, 0)}\u202f%` : "–");
    const slew = Number.isInteger(budget?.slewing_joint) ? ` Rise of torque limited at ${name(this.joints[budget.slewing_joint - 1]?.name ?? budget.slewing_joint)}.` : "";
    setText(this.scales, `Before scaling. Return to centre and damping at ${scale(budget?.assist_scale)}; task and assist together at ${scale(budget?.rest_scale)}${by(budget?.limiting_joint)}.${slew}`);
  }
}
