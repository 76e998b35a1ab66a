"""The link over a network, by zenoh over QUIC with mutual TLS, in the place of `frhc-link far`. docs/link.md has the keys."""
import collections
import json
import os
import re
import ssl
import string
import struct
from typing import Deque, Optional, Union

import zenoh

from .clock import MILLISECOND
from .codec import CAPABILITY_KIND, FEEDBACK_KIND
from .messages import Command
from .reasons import Rejected

IN_FLIGHT = 128  # messages without an echo, before one is sent every 20 ms
SLOW = 20 * MILLISECOND
WAITING = 64  # messages of the node that are kept; the oldest give way
ANY_ADDRESS = "0.0.0.0:7447"
FILES = "authority.pem", "far.pem", "far.key"

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


def configuration(arm: int, keys: str, listen: Optional[str], connect: Optional[str]) -> zenoh.Config:
    """Returns the configuration of a far end's session. Addresses are HOST:PORT."""
    def endpoints(address: Optional[str]) -> str:
        return json.dumps([f"quic/{address}?mixed_rel=1"] if address else [])

    def key_exprs(*names: str) -> str:
        return json.dumps([f"frhc/{arm}/{name}" for name in names])

    return zenoh.Config.from_json5(CONFIGURATION.substitute(
        listen=endpoints(listen), connect=endpoints(connect), keys=json.dumps(keys)[1:-1], arm=arm,
        taken=key_exprs("command"), sent=key_exprs("feedback", "capability")))


def checked_address(address: str) -> str:
    """Returns HOST:PORT. Raises ValueError if it is not that."""
    found = re.fullmatch(r"(\[[0-9a-fA-F:.]+\]|[\w.-]+):(\d{1,5})", address)
    if not found or int(found[2]) > 65535:
        raise ValueError(f"listen and connect must be HOST:PORT, got {address!r}")
    return address


def open_session(arm: int, keys: "Union[str, os.PathLike[str]]", listen: Optional[str] = None,
                 connect: Optional[str] = None) -> zenoh.Session:
    """Opens the session of a far end. Raises ValueError for an address, OSError for a key or a port."""
    if listen and connect:
        raise ValueError("give one of listen and connect")
    if not connect:
        listen = checked_address(listen or ANY_ADDRESS)
    else:
        checked_address(connect)
    folder = os.fspath(keys)
    try:
        for name in FILES:
            open(os.path.join(folder, name), "rb").close()  # zenoh would not name the file
        ssl.create_default_context(cafile=f"{folder}/authority.pem").load_cert_chain(
            f"{folder}/far.pem", f"{folder}/far.key", password="")
        return zenoh.open(configuration(arm, folder, listen, connect))
    except (OSError, zenoh.ZError) as error:
        raise OSError(f"cannot open with {folder}/far.pem: {str(error).split(' at /')[0]}") from error


class NetworkLink:
    """Messages of a zenoh session. Those beyond the flow of docs/link.md are dropped.

    Messages are read from a ring: with a callback, Python would not end while the session is open.
    """

    def __init__(self, arm: int, session: zenoh.Session) -> None:
        key = f"frhc/{arm}/"
        self._session = session
        self._own_session = 0
        self._next_send = 0
        self._not_echoed: Deque[int] = collections.deque(maxlen=IN_FLIGHT)  # numbers, in order
        self._publishers = {kind: session.declare_publisher(
            key + name, express=True, priority=zenoh.Priority.REAL_TIME, reliability=zenoh.Reliability.BEST_EFFORT,
            congestion_control=zenoh.CongestionControl.DROP)
            for kind, name in ((FEEDBACK_KIND, "feedback"), (CAPABILITY_KIND, "capability"))}
        self._subscriber = session.declare_subscriber(key + "command", zenoh.handlers.RingChannel(WAITING),
                                                      allowed_origin=zenoh.Locality.REMOTE)
        self._token = session.liveliness().declare_token(key + "alive/far")

    def receive(self, now: int) -> Optional[bytes]:
        """Returns the next message, None while no message waits."""
        sample = None if self._session.is_closed() else self._subscriber.try_recv()
        if sample is None:
            return None
        message = sample.payload.to_bytes()
        try:
            echo = Command.decode(message).head.echo
        except Rejected:
            return message
        if echo.session == self._own_session:
            while self._not_echoed and self._not_echoed[0] <= echo.sequence:
                self._not_echoed.popleft()
        return message

    def send(self, now: int, message: bytes) -> None:
        """Sends a message, if fewer than 128 wait for their echo or the last is 20 ms ago."""
        if len(self._not_echoed) < IN_FLIGHT or now >= self._next_send:
            self._next_send = now + SLOW
            self._own_session, number = struct.unpack_from("<2Q", message, 12)
            self._not_echoed.append(number)
            self._publishers[message[4]].put(message)

    def close(self) -> None:
        """Closes the session."""
        self._session.close()  # type: ignore[no-untyped-call]  # zenoh's stub has no return type
