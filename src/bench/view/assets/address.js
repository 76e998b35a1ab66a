// Settings in the address of the page: cameras, markers, theme.

const THEMES = ["light", "dark"];

function point(text) {
  const parts = (text ?? "").split(",").map(Number);
  return text && parts.length === 3 && parts.every(Number.isFinite) ? parts : null;
}

export function settings() {
  const given = new URLSearchParams(window.location.search);
  const camera = (view) => ({ eye: point(given.get(`${view}-eye`)), target: point(given.get(`${view}-target`)) });
  const markers = given.get("markers");
  const isOff = markers === null || markers === "" || markers === "0";
  return {
    hand: camera("hand"),
    robot: camera("robot"),
    // An empty set selects all of them.
    markers: isOff ? null : new Set(markers === "1" ? [] : markers.split(",")),
    theme: THEMES.find((theme) => theme === given.get("theme")) ?? null,
  };
}
