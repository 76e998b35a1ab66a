// Orbit and zoom by keys, buttons and pointer, with equal effects.

import { make } from "./text.js";

const STEP = 0.12; // rad
const ZOOM = 1.15;

/// Actions of a camera: label of the button, name, keys, function.
const ACTIONS = [
  ["←", "Orbit left", ["ArrowLeft"], (camera) => camera.orbit(-STEP, 0)],
  ["→", "Orbit right", ["ArrowRight"], (camera) => camera.orbit(STEP, 0)],
  ["↑", "Orbit up", ["ArrowUp"], (camera) => camera.orbit(0, STEP)],
  ["↓", "Orbit down", ["ArrowDown"], (camera) => camera.orbit(0, -STEP)],
  ["+", "Zoom in", ["+", "="], (camera) => camera.zoom(1 / ZOOM)],
  ["−", "Zoom out", ["-", "\u2212"], (camera) => camera.zoom(ZOOM)],
  ["0", "0: resets the camera", ["0"], (camera) => camera.reset()],
];

export function attach(canvas, camera, buttons) {
  for (const [sign, label, , act] of ACTIONS) {
    const button = buttons.appendChild(make("button", "", sign));
    button.type = "button";
    button.setAttribute("aria-label", label);
    button.title = label;
    button.addEventListener("click", () => act(camera));
  }
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const found = ACTIONS.find(([, , keys]) => keys.includes(event.key));
    if (!found) return;
    event.preventDefault();
    found[3](camera);
  });
  drag(canvas, camera);
  // The page scrolls, unless the view has the focus.
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas) return;
    event.preventDefault();
    camera.zoom(Math.exp(Math.max(-0.3, Math.min(0.3, event.deltaY * 0.0015))));
  }, { passive: false });
}

function drag(canvas, camera) {
  let last = null;
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    last = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!last) return;
    camera.orbit(-0.008 * (event.clientX - last[0]), 0.008 * (event.clientY - last[1]));
    last = [event.clientX, event.clientY];
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { last = null; });
}

/// Connects a button and a key to a toggle.
export function attachSwitch(button, key, toggle) {
  const press = () => button.setAttribute("aria-pressed", String(toggle()));
  button.addEventListener("click", press);
  document.addEventListener("keydown", (event) => {
    if (event.key === key && !event.ctrlKey && !event.metaKey && !event.altKey) press();
  });
}
