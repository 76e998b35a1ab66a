"""Sockets of a node, where `frhc ctl` and `frhc robot` look for them."""
import os
from typing import List, Mapping

SERVICE_FOLDER = "/run/frhc"
MAX_PATH = 107  # bytes, unix(7)


def default_folder(environment: Mapping[str, str] = os.environ) -> str:
    """Returns the folder of the node's sockets. Ignores a variable that is empty or a relative path."""
    service = environment.get("RUNTIME_DIRECTORY", "").split(":")[0]  # systemd.exec(5): with several folders, a list
    if os.path.isabs(service):
        return service
    user = environment.get("XDG_RUNTIME_DIR", "")
    return os.path.join(user, "frhc") if os.path.isabs(user) else SERVICE_FOLDER


def link_socket() -> str:
    """Returns the path on which a node listens for its far side, if none is configured."""
    return os.path.join(default_folder(), "link.sock")


def control_sockets() -> List[str]:
    """Returns the paths of control sockets to try: the user's own node, then the service."""
    return list(dict.fromkeys(os.path.join(folder, "node.sock") for folder in (default_folder(), SERVICE_FOLDER)))


def checked(path: "os.PathLike[str] | str") -> str:
    """Returns the path of a Unix socket. Raises ValueError if it cannot be one."""
    text = os.fspath(path)
    length = len(os.fsencode(text))
    if not 0 < length <= MAX_PATH:
        raise ValueError(f"socket must be a path of 1 to {MAX_PATH} bytes, got {length}")
    return text
