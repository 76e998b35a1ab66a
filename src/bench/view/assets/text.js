// Text of a node's data: numbers with signs, names without control characters, and elements that change only if necessary.

const MINUS = "\u2212";
const NONE = "\u2013";
const MAX_NAME = 64;

/// Returns a number with this number of decimal places; a dash if it is not a number.
export function number(value, digits) {
  if (!Number.isFinite(value)) return NONE;
  const text = value.toFixed(digits);
  const isZero = Number(text) === 0;
  return value < 0 && !isZero ? MINUS + text.slice(1) : text.replace("-", "");
}

/// Returns a number with its unit; only a dash if it is not a number.
export const quantity = (value, digits, unit) => (Number.isFinite(value) ? `${number(value, digits)}\u202f${unit}` : NONE);

/// Returns an integer in groups of three digits.
export function count(value) {
  if (!Number.isFinite(value)) return NONE;
  return number(value, 0).replace(/\B(?=(\d{3})+$)/g, "\u202f");
}

/// Returns a text of the node without control characters and without those that change the writing direction.
export function plain(value) {
  if (value === null || value === undefined) return NONE;
  const text = typeof value === "string" ? value : JSON.stringify(value) ?? NONE;
  return text.replace(/[\u0000-\u001f\u007f-\u009f\u200e\u200f\u202a-\u202e\u2066-\u2069]/g, "\ufffd");
}

/// Returns a name short enough for a table.
export function name(value) {
  const letters = Array.from(plain(value));
  return letters.length > MAX_NAME ? `${letters.slice(0, MAX_NAME).join("")}…` : letters.join("");
}

/// Sets the text of an element, if it differs.
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function setHidden(element, isHidden) {
  if (element.hidden !== isHidden) element.hidden = isHidden;
}

/// Returns a new element with a class and a text.
export function make(tag, className = "", text = "") {
  const element = document.createElement(tag);
  if (className) element.className = className;
  if (text) element.textContent = text;
  return element;
}

/// Returns a share of a bar from 0 to 1, for CSS.
export const part = (value) => (Number.isFinite(value) ? Math.min(1, Math.max(0, value)) : 0);
