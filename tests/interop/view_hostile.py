"""`frhc view` against those who may not look: a page of another origin in the same browser, a name that was made to lead here
(DNS rebinding), and raw connections. None gets a line of the telemetry, nothing reaches the node, and a page that is open goes on.
"""

import contextlib
import socket
import tempfile
import threading
import time
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import urlsplit

from browser import SOFTWARE_GL, Browser
from telemetry_feed import Feed, Motion, description
from view import drawn, is_sound, page, until

FOREIGN_NAME = "evil.example"
# Chromium takes this name for this machine, as a name server of the attacker would say.
REBOUND = [f"--host-resolver-rules=MAP {FOREIGN_NAME} 127.0.0.1", "--no-proxy-server"]
HALF_OPEN = 100
ANSWER_TIMEOUT_S = 3

# Each attempt resolves to what it got; "nothing" is what must come.
ATTACK = """
const [target, done] = arguments;
const wait = (start) => new Promise((resolve) => { start(resolve); setTimeout(() => resolve("nothing"), 1500); });
const read = (url, options) => fetch(url, options).then(async (answer) => {
  if (answer.type === "opaque") return "opaque";
  const { value } = await answer.body.getReader().read();
  return `${answer.status} ${new TextDecoder().decode(value)}`;
}, () => "nothing");
const element = (name, key, path) => wait((resolve) => {
  const made = document.createElement(name);
  made.onload = () => resolve("loaded");
  made.onerror = () => resolve("nothing");
  if (name === "link") made.rel = "stylesheet";
  made[key] = target + path;
  document.body.append(made);
});
const frame = (path) => wait((resolve) => {
  const made = document.createElement("iframe");
  made.onload = () => setTimeout(() => {
    let inside = null;
    try { inside = made.contentDocument?.body?.innerText || null; } catch { inside = null; }
    resolve(inside ?? "nothing");
  }, 200);
  made.src = target + path;
  document.body.append(made);
});
const form = () => wait((resolve) => {
  const box = Object.assign(document.createElement("iframe"), { name: "box" });
  const made = Object.assign(document.createElement("form"), { method: "post", action: target + "feed", target: "box" });
  document.body.append(box, made);
  let count = 0;
  box.onload = () => { count += 1; let text = null; try { text = box.contentDocument?.body?.innerText || null; } catch {} if (text) resolve(text); };
  made.submit();
});
const events = () => wait((resolve) => {
  const source = new EventSource(target + "feed");
  for (const kind of ["description", "mode", "snapshot", "message"]) source.addEventListener(kind, (event) => resolve(event.data));
});
const socket = () => wait((resolve) => {
  const made = new WebSocket(target.replace("http", "ws") + "feed");
  made.onopen = () => resolve("open");
  made.onerror = () => resolve("nothing");
});
const attempts = {
  "fetch": read(target + "feed"), "fetch of the page": read(target), "fetch without CORS": read(target + "feed", { mode: "no-cors" }),
  "fetch with credentials": read(target + "feed", { credentials: "include" }), "post": read(target + "feed", { method: "POST", mode: "no-cors", body: "arm" }),
  "put": read(target + "feed", { method: "PUT", body: "arm" }), "EventSource": events(), "WebSocket": socket(),
  "script": element("script", "src", "feed"), "script of the page": element("script", "src", "main.js"), "img": element("img", "src", "icon.svg"),
  "style": element("link", "href", "view.css"), "iframe": frame(""), "iframe of the feed": frame("feed"), "form": form(),
};
navigator.sendBeacon(target + "feed", "arm");
Promise.all(Object.entries(attempts).map(async ([name, got]) => [name, await got])).then((pairs) => done(Object.fromEntries(pairs)));
"""


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@contextlib.contextmanager
def foreign_page(folder):
    """Serves a page of another origin; gives its port."""
    (Path(folder) / "index.html").write_text("<!DOCTYPE html><title>elsewhere</title><body></body>")
    with served(partial(Quiet, directory=folder)) as port:
        yield port


class Permissive(Quiet):
    """A server that gives all to everyone, as a page of an unguarded node would."""

    def do_GET(self):
        kind = {"feed": "text/event-stream", "main.js": "text/javascript", "icon.svg": "image/svg+xml", "view.css": "text/css"}.get(self.path[1:], "text/html")
        texts = {"feed": "event: description\ndata: {}\n\n", "icon.svg": '<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"/>'}
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Access-Control-Allow-Origin", self.headers["Origin"] or "*")
        self.send_header("Access-Control-Allow-Credentials", "true")
        self.end_headers()
        self.wfile.write(texts.get(self.path[1:], "").encode() or b" ")


# Attempts by which a page of another origin gets something from such a server. What is in a frame no browser shows to another origin,
# and a form has no answer there: of these only what reaches the node counts.
LEAKS = {"fetch", "fetch of the page", "fetch with credentials", "fetch without CORS", "EventSource", "script of the page", "img", "style"}


@contextlib.contextmanager
def served(handler):
    """Serves a page of another origin, or without a guard; gives its port."""
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield server.server_port
        finally:
            server.shutdown()


def nothing_was_sent_to_the_node(feed):
    """Fails if a reader of the fake node has sent a byte."""
    with feed.lock:
        assert feed.readers, "the feed has no reader"
        for reader in feed.readers:
            with contextlib.suppress(BlockingIOError):
                assert reader.recv(1, socket.MSG_DONTWAIT | socket.MSG_PEEK) == b"", "a byte came from the page's server"


def goes_on(browser):
    """Fails unless an open page gets further snapshots."""
    cycle = browser.script("return document.documentElement.dataset.cycle")
    until(browser, f"Number(document.documentElement.dataset.cycle) > {cycle} + 100", "further snapshots")


@contextlib.contextmanager
def shown(flags=SOFTWARE_GL):
    """Gives an open page: its browser, address and feed."""
    with tempfile.TemporaryDirectory() as folder, page(folder) as (url, node), Feed(node, Motion(description())) as feed, Browser(flags) as browser:
        browser.open_url(url)
        drawn(browser)
        yield browser, url, feed


def view_gives_nothing_to_a_page_of_another_origin(_):
    with shown([*SOFTWARE_GL, *REBOUND]) as (browser, url, feed), tempfile.TemporaryDirectory() as folder, foreign_page(folder) as port:
        own = browser.command("GET", "/window")
        other = browser.command("POST", "/window/new", type="tab")["handle"]
        browser.command("POST", "/window", handle=other)
        for host in ("127.0.0.1", "localhost", FOREIGN_NAME):
            browser.command("POST", "/url", url=f"http://{host}:{port}/")
            got = browser.command("POST", "/execute/async", script=ATTACK, args=[url])
            assert len(got) == 15 and set(got.values()) == {"nothing"}, (host, got)
        with served(Permissive) as unguarded:
            got = browser.command("POST", "/execute/async", script=ATTACK, args=[f"http://127.0.0.1:{unguarded}/"])
            assert {name for name, what in got.items() if what != "nothing"} >= LEAKS, f"the attempts do not work: {got}"
        # The same port under a name of the attacker: the origin is then the page's own, as far as the browser knows.
        browser.command("POST", "/url", url=f"http://{FOREIGN_NAME}:{urlsplit(url).port}/")
        text = browser.script("return document.body.innerText")
        assert "not one that frhc view answers to" in text, text
        rebound = "const done = arguments[0]; fetch('/feed').then(async (answer) => done([answer.status, (await answer.text()).includes('kind')]), (error) => done(String(error)))"
        assert browser.command("POST", "/execute/async", script=rebound, args=[]) == [403, False]
        browser.command("POST", "/window", handle=own)
        browser.errors()  # those of the other page
        goes_on(browser)
        is_sound(browser, "attacked")
        nothing_was_sent_to_the_node(feed)


def answer(address, request):
    """Sends bytes; returns what comes within a time, up to the first line of the telemetry."""
    with socket.create_connection(address, timeout=ANSWER_TIMEOUT_S) as connection:
        got = b""
        with contextlib.suppress(TimeoutError, ConnectionResetError, BrokenPipeError):
            connection.sendall(request)
            while b'"kind"' not in got and (part := connection.recv(65536)):
                got += part
        return got


def view_refuses_raw_requests_that_are_not_its_page(_):
    with shown() as (browser, url, feed):
        address = ("127.0.0.1", urlsplit(url).port)
        host = f"Host: 127.0.0.1:{address[1]}\r\n"
        own = f"GET /feed HTTP/1.1\r\n{host}"
        assert b'"kind":"description"' in answer(address, f"{own}\r\n".encode()).replace(b" ", b""), "the feed is not there"
        refused = {
            f"GET /feed HTTP/1.1\r\nHost: {FOREIGN_NAME}:{address[1]}\r\n\r\n": (b"403",),
            "GET /feed HTTP/1.1\r\n\r\n": (b"400", b"403"),
            "GET /feed HTTP/1.0\r\n\r\n": (b"400", b"403"),
            f"GET /feed HTTP/1.1\r\n{host}{host}\r\n": (b"400", b"403"),
            f"GET http://{FOREIGN_NAME}/feed HTTP/1.1\r\n{host}\r\n": (b"400", b"403"),
            f"{own}Origin: http://{FOREIGN_NAME}\r\n\r\n": (b"403",),
            f"{own}Origin: null\r\n\r\n": (b"403",),
            f"{own}Sec-Fetch-Site: cross-site\r\n\r\n": (b"403",),
            **{f"{method} /feed HTTP/1.1\r\n{host}Content-Length: 3\r\n\r\narm": (b"405",) for method in ("POST", "PUT", "DELETE", "PATCH", "OPTIONS")},
            f"CONNECT 127.0.0.1:{address[1]} HTTP/1.1\r\n{host}\r\n": (b"400", b"403", b"405"),
            f"{own}X: {'a' * 2_000_000}\r\n\r\n": (b"400", b"431", b""),
            own + "".join(f"X-{number}: 1\r\n" for number in range(2000)) + "\r\n": (b"400", b"431", b""),
            f"GET /{'a' * 200_000} HTTP/1.1\r\n{host}\r\n": (b"404", b"414", b""),
            f"GET /../../etc/passwd HTTP/1.1\r\n{host}\r\n": (b"404", b"400"),
            f"{own}Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nOrigin: http://{FOREIGN_NAME}\r\n\r\n": (b"403",),
            "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n": (b"400", b"505", b"403", b""),
            "\x00\xff\r\n\r\n": (b"400", b""),
        }
        for request, statuses in refused.items():
            got = answer(address, request.encode("latin-1"))
            status = got.split(b" ", 2)[1] if got.startswith(b"HTTP/") else b""
            assert status in statuses and b'"kind"' not in got, (request[:80], got[:200])
        goes_on(browser)
        nothing_was_sent_to_the_node(feed)


def view_keeps_open_pages_beside_half_open_connections(_):
    with shown() as (browser, url, feed), contextlib.ExitStack() as stack:
        address = ("127.0.0.1", urlsplit(url).port)
        for number in range(HALF_OPEN):
            connection = stack.enter_context(socket.create_connection(address, timeout=ANSWER_TIMEOUT_S))
            connection.sendall(b"GET /feed HTTP/1.1\r\nHost: 127"[: number % 30])
        goes_on(browser)
        start = time.monotonic()
        browser.open_url(url)
        drawn(browser)
        print(f"  page beside {HALF_OPEN} half-open connections drawn within {time.monotonic() - start:.1f} s", flush=True)
        is_sound(browser, "half-open")
        nothing_was_sent_to_the_node(feed)


TESTS = [
    view_gives_nothing_to_a_page_of_another_origin,
    view_refuses_raw_requests_that_are_not_its_page,
    view_keeps_open_pages_beside_half_open_connections,
]
