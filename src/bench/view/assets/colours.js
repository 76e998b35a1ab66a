// Colours of both themes, in sRGB; those of curves and arrows are distinct also with colour blindness (Okabe and Ito 2008).

const rgb = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255);

const hexes = {
  light: {
    ground: "#fbfcfd", floor: "#e3e8ec", grid: "#d3dae0", shadow: "#e4e9ed", link: "#c3ccd4", base: "#8d99a4", joint: "#4b7294", cap: "#365570",
    grip: "#3a434c", tool: "#e69f00", rig: "#b98200", wall: "#7f8b96", hatching: "#66727d", solid: "#b9a88f", sensed: "#d55e00", felt: "#0072b2",
    rod: "#dfe5ea",
  },
  dark: {
    ground: "#13171b", floor: "#1d2329", grid: "#2b333b", shadow: "#0b0e11", link: "#8d99a5", base: "#5d6873", joint: "#5b7f9f", cap: "#42617c",
    grip: "#c5cdd4", tool: "#e69f00", rig: "#b98200", wall: "#8d99a5", hatching: "#a3afba", solid: "#93836b", sensed: "#ff8a3d", felt: "#56b4e9",
    rod: "#aeb8c2",
  },
};

/// Colours of the 3D pictures, as fractions of 1.
export function palette(theme) {
  return Object.fromEntries(Object.entries(hexes[theme] ?? hexes.light).map(([name, hex]) => [name, rgb(hex)]));
}

/// Axes of a frame: x, y, z; pale, so that they differ from arrows.
export const AXES = [rgb("#b98f95"), rgb("#8fae95"), rgb("#9095bd")];

/// Curves of the charts, in order: six of one chart differ in colour and dashes.
export function curves(theme) {
  return theme === "dark"
    ? ["#56b4e9", "#ff9a57", "#2fc896", "#f0e442", "#e08fc0", "#b8c4cf"]
    : ["#0072b2", "#c04f00", "#00785a", "#8a6d00", "#a8447a", "#4a545e"];
}

export const DASHES = [[], [6, 3], [2, 2], [9, 3, 2, 3], [4, 4], [1, 3]];

/// Markers and arrows of `?markers=`: docs/view.md has this table.
export const MARKERS = {
  "joint-1": rgb("#ff0000"), "joint-2": rgb("#00ff00"), "joint-3": rgb("#0000ff"), "joint-4": rgb("#ffff00"), "joint-5": rgb("#ff00ff"),
  "joint-6": rgb("#00ffff"), "joint-7": rgb("#ff8000"), "joint-8": rgb("#8000ff"), "joint-9": rgb("#00ff80"), grip: rgb("#ff0080"), mrf: rgb("#0080ff"),
};

export const MARKED_ARROWS = {
  sensed: { shaft: rgb("#a05a00"), tip: rgb("#80ff00"), tail: rgb("#800000") },
  felt: { shaft: rgb("#006464"), tip: rgb("#ff80ff"), tail: rgb("#004080") },
};
