#!/usr/bin/env python3
"""Far side of docs/link.md over a network, with the simulated robot of far_side_local.py.

    far_side.py KEYS [--listen HOST:PORT | --connect HOST:PORT] [--arm N] [--wall AXIS POSITION] [--start X Y Z]

Takes the place of `frhc-link far` and of the robot. KEYS is a folder of `frhc-link key new` with authority.pem,
far.pem and far.key. Runs until SIGTERM or SIGINT. Exit code 2: invalid arguments; 4: a key or the port cannot be
opened. A far side that listens logs refused certificates; RUST_LOG sets zenoh's log.

Python 3.9 or later on Linux, with eclipse-zenoh 1.10.2.
"""
import collections
import json
import re
import ssl
import string
import struct

import zenoh
from far_side_local import MAX_MESSAGES, Parser, arguments, clock, run, unpack_command

IN_FLIGHT, SLOW_NS = 128, 20_000_000  # messages without an echo, before one is sent every 20 ms

CONFIGURATION = string.Template("""{
  mode: "peer", region_name: "far",  // a router forwards between regions
  timestamping: {enabled: false}, scouting: {multicast: {enabled: false}, gossip: {enabled: false}},
  listen: {endpoints: $listen}, open: {return_conditions: {connect_scouted: false}},
  connect: {endpoints: $connect, timeout_ms: -1, exit_on_failure: false,
            retry: {period_init_ms: 100, period_max_ms: 500}},
  transport: {unicast: {open_timeout: 1000, accept_timeout: 1000, max_links: 1}, shared_memory: {enabled: false},
    link: {tx: {lease: 1000}, tls: {enable_mtls: true, verify_name_on_connect: false,
      root_ca_certificate: "$keys/authority.pem",
      listen_certificate: "$keys/far.pem", listen_private_key: "$keys/far.key",
      connect_certificate: "$keys/far.pem", connect_private_key: "$keys/far.key"}}},
  // Ends with these common names may do what the rules allow. All other is denied.
  access_control: {enabled: true, default_permission: "deny",
    subjects: [{id: "near", cert_common_names: ["frhc-$arm-near", "frhc-$arm-router"]}],
    policies: [{subjects: ["near"], rules: ["take", "ask", "send", "asked", "alive"]}],
    rules: [
      {id: "take", permission: "allow", flows: ["ingress"], messages: ["put"], key_exprs: $taken},
      {id: "ask", permission: "allow", flows: ["egress"], messages: ["declare_subscriber"], key_exprs: $taken},
      {id: "send", permission: "allow", flows: ["egress"], messages: ["put"], key_exprs: $sent},
      {id: "asked", permission: "allow", flows: ["ingress"], messages: ["declare_subscriber"], key_exprs: $sent},
      {id: "alive", permission: "allow", flows: ["ingress", "egress"], key_exprs: ["frhc/$arm/alive/*"],
       messages: ["liveliness_token", "liveliness_query", "declare_liveliness_subscriber"]}]}}""")


def configuration(args):
    endpoints = lambda address: json.dumps([f"quic/{address}?mixed_rel=1"] if address else [])
    key_exprs = lambda *names: json.dumps([f"frhc/{args.arm}/{name}" for name in names])
    return zenoh.Config.from_json5(CONFIGURATION.substitute(
        listen=endpoints(args.listen), connect=endpoints(args.connect), keys=json.dumps(args.keys)[1:-1], arm=args.arm,
        taken=key_exprs("command"), sent=key_exprs("feedback", "capability")))


class Link:
    """Messages of a zenoh session. Those beyond the flow of docs/link.md are dropped."""

    def __init__(self, session, arm):
        key, self.arm, self.session, self.next_send = f"frhc/{arm}/", arm, 0, 0
        self.waiting = collections.deque(maxlen=MAX_MESSAGES)  # of the node; the oldest give way
        self.not_echoed = collections.deque(maxlen=IN_FLIGHT)  # sequences, in order
        options = dict(express=True, priority=zenoh.Priority.REAL_TIME, reliability=zenoh.Reliability.BEST_EFFORT,
                       congestion_control=zenoh.CongestionControl.DROP)
        self.publishers = {2: session.declare_publisher(key + "feedback", **options),
                           3: session.declare_publisher(key + "capability", **options)}
        self.subscriber = session.declare_subscriber(
            key + "command", lambda sample: self.waiting.append(bytes(sample.payload)),
            allowed_origin=zenoh.Locality.REMOTE)
        self.token = session.liveliness().declare_token(key + "alive/far")

    def receive(self):
        """Returns the next message, None while no message waits."""
        message = self.waiting.popleft() if self.waiting else None
        command = unpack_command(message, self.arm) if message else None
        if command and command.echoed_session == self.session:
            while self.not_echoed and self.not_echoed[0] <= command.echoed_sequence:
                self.not_echoed.popleft()
        return message

    def send(self, message):
        now = clock()
        if len(self.not_echoed) < IN_FLIGHT or now >= self.next_send:
            self.next_send = now + SLOW_NS
            self.session, sequence = struct.unpack_from("<2Q", message, 12)
            self.not_echoed.append(sequence)
            self.publishers[message[4]].put(message)


def main():
    parser = Parser(description="Far side of docs/link.md over a network.", allow_abbrev=False)
    parser.add_argument("keys", help="folder with authority.pem, far.pem and far.key")
    end = parser.add_mutually_exclusive_group()
    end.add_argument("--listen", metavar="HOST:PORT", help="UDP address (default 0.0.0.0:7447)")
    end.add_argument("--connect", metavar="HOST:PORT", help="UDP address of the near end or of a router")
    args = arguments(parser)
    if args.listen is None and args.connect is None:
        args.listen = "0.0.0.0:7447"
    address = re.fullmatch(r"(\[[0-9a-fA-F:.]+\]|[\w.-]+):(\d{1,5})", args.listen or args.connect or "")
    if not address or int(address[2]) > 65535:
        parser.error(f"--listen and --connect must be HOST:PORT, got {args.listen or args.connect!r}")
    zenoh.init_log_from_env_or("error,zenoh_link_commons::quic::unicast=warn")
    try:
        for name in ("authority.pem", "far.pem", "far.key"):
            open(f"{args.keys}/{name}", "rb").close()  # zenoh would not name the file
        ssl.create_default_context(cafile=f"{args.keys}/authority.pem").load_cert_chain(
            f"{args.keys}/far.pem", f"{args.keys}/far.key", password="")
        session = zenoh.open(configuration(args))
    except (OSError, zenoh.ZError) as error:
        parser.exit(4, f"{parser.prog}: cannot open with {args.keys}/far.pem: {str(error).split(' at /')[0]}\n")
    with session:
        run(args, Link(session, args.arm))


if __name__ == "__main__":
    main()
