// Bar: used share of a limit, with marks for other values.

import { make, part, setText } from "./text.js";

const HIGH = 0.9; // share of the limit from which a bar has another colour

/// Bar without a name, for a table cell.
export class Bar {
  constructor(className = "") {
    this.element = make("div", `bar ${className}`.trim());
    this.element.setAttribute("aria-hidden", "true");
    this.fill = this.element.appendChild(make("i"));
    this.marks = [];
  }

  set(share, highFrom = HIGH) {
    this.fill.style.transform = `scaleX(${part(share).toFixed(3)})`;
    this.element.classList.toggle("high", share >= highFrom);
  }

  /// Places marks at these shares; values that are not numbers are skipped.
  mark(...shares) {
    shares.forEach((share, index) => {
      this.marks[index] ??= this.element.appendChild(make("u"));
      this.marks[index].hidden = !Number.isFinite(share);
      this.marks[index].style.left = `${(100 * part(share)).toFixed(1)}%`;
    });
  }
}

/// Bar with its name and value above.
export class NamedBar {
  constructor(parent, label) {
    const row = parent.appendChild(make("div"));
    const head = row.appendChild(make("p"));
    this.label = head.appendChild(make("b", "", label));
    this.value = head.appendChild(make("span"));
    this.bar = new Bar();
    row.append(this.bar.element);
  }

  set(text, share, highFrom) {
    setText(this.value, text);
    this.bar.set(share, highFrom);
  }
}

/// Bars of a list whose names arrive with the values; recreated only if the names change.
export class BarList {
  constructor(parent) {
    this.parent = parent;
    this.names = "";
    this.bars = [];
  }

  match(names) {
    const key = JSON.stringify(names);
    if (key !== this.names) {
      this.names = key;
      this.parent.replaceChildren();
      this.bars = names.map((label) => new NamedBar(this.parent, label));
    }
    return this.bars;
  }
}
