"""A page of `frhc view` with a fault put into one of its files, by a server between it and the browser."""

import contextlib
import http.client
import threading
import urllib.error
import urllib.request
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


@contextlib.contextmanager
def mutated(url, file="main.js", text="", fault=""):
    """Serves the page at `url` with one text of a file replaced, which must be there once; gives its address. No text, no fault."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            try:
                with urllib.request.urlopen(url + self.path[1:]) as answer:
                    self.send_response(200)
                    self.send_header("Content-Type", answer.headers["Content-Type"])
                    self.end_headers()
                    if self.path == f"/{file}" and text:
                        content = answer.read().decode()
                        self.wfile.write(content.replace(text, fault).encode())
                        return
                    while part := answer.read1():
                        self.wfile.write(part)
                        self.wfile.flush()
            except (OSError, http.client.HTTPException):
                return  # one of both ends has closed the connection

        def log_message(self, *_):
            pass

    with urllib.request.urlopen(url + file) as answer:
        content = answer.read().decode()
    if text and content.count(text) != 1:
        raise ValueError(f"{file} has {content.count(text)} times: {text}")
    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/"
        finally:
            server.shutdown()
