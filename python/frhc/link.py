"""What carries the messages of one far side: a packet is a message, and nothing waits."""
from typing import Optional, Protocol


class Link(Protocol):
    """Carrier of messages. A message for which there is no room, or no node, is dropped."""

    def receive(self, now: int) -> Optional[bytes]:
        """Returns the next message, None while no message waits. Connects again where that is due."""

    def send(self, now: int, message: bytes) -> None:
        """Sends a message."""

    def close(self) -> None:
        """Closes the connection for good."""
