#!/usr/bin/env python3
"""readers.py COUNT SOCKET: connects COUNT times to the telemetry of a node, and reads until it ends. Who stops this process stops all of them."""

import selectors
import socket
import sys
import time

count, path = int(sys.argv[1]), sys.argv[2]
selector = selectors.DefaultSelector()
for _ in range(count):
    reader = socket.socket(socket.AF_UNIX)
    while reader.connect_ex(path):
        time.sleep(0.05)
    selector.register(reader, selectors.EVENT_READ)
while selector.get_map():
    for key, _ in selector.select():
        if not key.fileobj.recv(1 << 16):
            selector.unregister(key.fileobj)
