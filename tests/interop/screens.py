"""What a screenshot of `frhc view` shows: its pixels, the discs of its markers, and where a stated camera (docs/view.md) puts a point.

No code of the page: PNG by zlib and numpy, projection by the text of the documentation.
"""

import base64
import json
import math
import struct
import zlib

import numpy as np

JOINT_COLOURS = ["#ff0000", "#00ff00", "#0000ff", "#ffff00", "#ff00ff", "#00ffff", "#ff8000", "#8000ff", "#00ff80"]
# In the order in which they are drawn.
COLOURS = {
    "felt": "#006464", "felt-tip": "#ff80ff", "felt-tail": "#004080", "sensed": "#a05a00", "sensed-tip": "#80ff00", "sensed-tail": "#800000",
    **{f"joint-{number}": colour for number, colour in enumerate(JOINT_COLOURS, 1)}, "grip": "#ff0080", "mrf": "#0080ff",
}
MARKER_PX = 9
# Pixels about a marker, at ratios up to 2: rows of x, y.
DISC_WINDOW = np.stack(np.meshgrid(range(-10, 11), range(-10, 11)), axis=-1).reshape(-1, 2)
MIN_SEEN = 12  # pixels of 63, at a device pixel ratio of 1


def pixels(png):
    """Returns the pixels of an RGB or RGBA picture of 8 bits as rows, columns, channels (PNG, W3C 2003, 9)."""
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    at, parts = 8, []
    while at < len(png):
        size, kind = struct.unpack(">I4s", png[at : at + 8])
        content = png[at + 8 : at + 8 + size]
        if kind == b"IHDR":
            width, height, depth, colour, _, _, interlaced = struct.unpack(">IIBBBBB", content)
            assert depth == 8 and colour in (2, 6) and not interlaced, (depth, colour, interlaced)
        elif kind == b"IDAT":
            parts.append(content)
        at += size + 12
    channels = 3 if colour == 2 else 4
    rows = np.frombuffer(zlib.decompress(b"".join(parts)), np.uint8).reshape(height, 1 + width * channels)
    picture = np.zeros((height + 1, width, channels), np.uint8)
    for number, row in enumerate(rows):
        picture[number + 1] = unfiltered(row[0], row[1:].reshape(width, channels), picture[number])
    return picture[1:, :, :3]


def unfiltered(kind, row, above):
    """Returns a row of pixels from its filtered bytes and the row above."""
    if kind == 0:
        return row
    if kind == 1:
        return np.cumsum(row, axis=0, dtype=np.uint8)
    if kind == 2:
        return row + above
    done = np.zeros_like(row)
    left, corner = np.zeros(row.shape[1], int), np.zeros(row.shape[1], int)
    for number, (part, up) in enumerate(zip(row.astype(int), above.astype(int))):
        guess = (left + up) // 2 if kind == 3 else paeth(left, up, corner)
        left, corner = (part + guess) % 256, up
        done[number] = left
    return done


def paeth(left, up, corner):
    """Returns of each channel the neighbour that is nearest to left + up - corner."""
    far = [abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)]
    return np.where((far[0] <= far[1]) & (far[0] <= far[2]), left, np.where(far[1] <= far[2], up, corner))


class Picture:
    """One canvas in a screenshot, with its stated camera."""

    def __init__(self, browser, views):
        answer = browser.devtools("Page.captureScreenshot", format="png", optimizeForSpeed=True)
        self.all = pixels(base64.b64decode(answer["data"]))
        self.views = views

    def of(self, view):
        """Returns the part of a view, "hand" or "robot": its pixels, and its camera."""
        (left, top, width, height), camera, ratio = self.views[view]
        low, high = [math.ceil(ratio * top), math.ceil(ratio * left)], [math.floor(ratio * (top + height)), math.floor(ratio * (left + width))]
        assert high[0] <= self.all.shape[0] and high[1] <= self.all.shape[1], "the view is not in the screenshot"
        part = self.all[low[0] : high[0], low[1] : high[1]]
        return Canvas(part, Camera(camera, ratio, np.array([ratio * left - low[1], ratio * top - low[0]])))


def shot(browser):
    """Takes a picture of both views."""
    stated = browser.script("""return ["hand", "robot"].map(id => {
        const canvas = document.getElementById(`${id}-view`), box = canvas.getBoundingClientRect();
        const left = box.left + canvas.clientLeft, top = box.top + canvas.clientTop;
        return [id, [[left, top, canvas.clientWidth, canvas.clientHeight], canvas.dataset.camera, window.devicePixelRatio]];
    })""")
    return Picture(browser, {view: (box, json.loads(camera), ratio) for view, (box, camera, ratio) in stated})


class Camera:
    """The pinhole that a canvas states, in pixels of the screen."""

    def __init__(self, stated, ratio=1.0, offset=(0.0, 0.0)):
        self.eye, target, up = (np.array(stated[key], float) for key in ("eye", "target", "up"))
        self.back = (self.eye - target) / np.linalg.norm(self.eye - target)
        across = np.cross(up, self.back)
        self.right = across / np.linalg.norm(across)
        self.above = np.cross(self.back, self.right)
        self.size = np.array([stated["width"], stated["height"]], float)
        self.focal = stated["height"] / (2 * math.tan(math.radians(stated["fov_y_deg"]) / 2))
        self.ratio, self.offset = ratio, np.array(offset)

    def project(self, point):
        """Returns where a point in m appears, from the left upper corner."""
        ray = np.asarray(point, float) - self.eye
        depth = -ray @ self.back
        assert depth > 0, f"{point} is behind the eye"
        css = self.size / 2 + self.focal / depth * np.array([ray @ self.right, -ray @ self.above])
        return self.ratio * css + self.offset

    def has(self, point, margin=MARKER_PX):
        """Returns whether a disc at a point is wholly in the picture."""
        at = (self.project(point) - self.offset) / self.ratio
        return bool((at >= margin).all() and (at <= self.size - margin).all())


class Canvas:
    """Pixels of one view."""

    def __init__(self, part, camera):
        self.camera = camera
        self.packed = part.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)

    def found(self, name):
        """Returns the centres of the pixels that have a marker's colour, as x, y."""
        return np.argwhere(self.packed == int(COLOURS[name][1:], 16))[:, ::-1] + 0.5

    def expected(self, points):
        """Returns the centres of the pixels of each marker's disc, by name, less those that a later one covers."""
        at = {name: self.camera.project(points[name]) for name in sorted(points, key=list(COLOURS).index)}
        seen = {}
        for number, (name, place) in enumerate(at.items()):
            disc = DISC_WINDOW + np.floor(place) + 0.5
            later = list(at.values())[number + 1 :]
            seen[name] = disc[self.covers(place, disc) & ~np.any([self.covers(other, disc) for other in later], axis=0)] if later else disc[self.covers(place, disc)]
        return seen

    def covers(self, place, where):
        """Returns which of these pixels a disc at a place has."""
        return ((where - place) ** 2).sum(axis=1) <= (self.camera.ratio * MARKER_PX / 2) ** 2

    def distances(self, points):
        """Returns how far each marker is from its place, in CSS px; None where others hide it by prediction."""
        distances = {}
        for name, wanted in self.expected(points).items():
            found = self.found(name)
            if len(wanted) < MIN_SEEN * self.camera.ratio**2:
                distances[name] = None
                continue
            assert 2 * len(found) >= len(wanted), f"{name} is not in the picture: {len(found)} pixels of {len(wanted)}"
            distances[name] = float(np.linalg.norm(found.mean(axis=0) - wanted.mean(axis=0)) / self.camera.ratio)
        return distances
