// The wrench of a view in words: a label at the tip of its arrow, and a line below the picture.

import { METRES_PER_NEWTON as FELT_SCALE } from "./hand_scene.js";
import { length } from "./linear.js";
import { METRES_PER_NEWTON as SENSED_SCALE } from "./robot_scene.js";
import { make, quantity, setHidden, setText } from "./text.js";

const KINDS = {
  hand: { title: "Felt at the grip", scale: FELT_SCALE, absent: "not known near a singularity" },
  robot: { title: "Sensed at {S}", scale: SENSED_SCALE, absent: "not known" },
};
const OFFSET_PX = 10;

/// Places the label of the arrow beside its tip; with markers there is no label, since it could cover a disc.
export function placeLabel({ stage, scene, label, canvas }) {
  const acting = stage.painter && !stage.markers ? scene.arrow() : null;
  const tip = acting && stage.camera.project(acting.tip);
  const isShown = tip !== null && tip[0] > 0 && tip[1] > 0 && tip[0] < canvas.clientWidth && tip[1] < canvas.clientHeight;
  setHidden(label, !isShown);
  if (!isShown) return;
  // At most ten times a second, as all text.
  const now = performance.now();
  if (!(now - label.since < 100)) {
    label.since = now;
    setText(label, quantity(acting.newtons, acting.newtons < 10 ? 2 : 1, "N"));
    label.size = [label.offsetWidth, label.offsetHeight];
  }
  const [width, height] = label.size ?? [60, 24];
  const tail = stage.camera.project(acting.tail) ?? tip;
  const [dx, dy] = [tip[0] - tail[0], tip[1] - tail[1]];
  const size = Math.hypot(dx, dy) || 1;
  // Beyond the tip, by the extent of the label in that direction.
  const x = within(tip[0] + (dx / size) * (width / 2 + OFFSET_PX) - width / 2, canvas.clientWidth - width);
  const y = within(tip[1] + (dy / size) * (height / 2 + OFFSET_PX) - height / 2, canvas.clientHeight - height);
  label.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
}

const within = (value, most) => Math.max(2, Math.min(value, most - 2));

/// Shows the wrench in N and N·m, and the scale of its arrow.
export function tellWrench({ id, scene }) {
  const { title, scale, absent } = KINDS[id];
  const line = document.getElementById(`${id}-wrench`);
  if (line.childElementCount === 0) line.append(make("span"), make("b"), make("span"));
  const [before, value, after] = line.children;
  const acting = scene.acting;
  setText(before, `${title}: `);
  setText(value, acting ? `${quantity(length(acting.force), 2, "N")}, ${quantity(length(acting.moment), 3, "N·m")}` : absent);
  setText(after, ` · arrow ${Math.round(scale * 1000)}\u202fmm/N`);
}
