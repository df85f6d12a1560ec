"""Hands a connection from the web server to the stream process over a unix socket, with what was read of it.

Each message is what the reader has sent so far, with the connection beside it (SCM_RIGHTS, unix(7)). What the stream
process does not take, the site answers itself with 503, and the page polls.
"""

import socket
import threading
from pathlib import Path

_BEGINNINGS = (b"GET /stream/ ", b"GET /stream/?", b"GET /stream/health ", b"GET /stream/clock ")
MOST_BYTES = 64 * 1024
WAITING = 128


def is_for_stream(received: bytes) -> bool:
    return received.startswith(_BEGINNINGS)


class Sender:
    """The web server's side: one connection to the stream process for each process of it. It never waits."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._link: socket.socket | None = None
        self._lock = threading.Lock()

    def hand_over(self, connection: int, received: bytes) -> bool:
        """Hand over a connection, by its descriptor; the caller then closes its own. False: it was not taken."""
        with self._lock:
            return any(self._send(connection, received) for _ in range(2))  # the link may be one to a process that died

    def _send(self, connection: int, received: bytes) -> bool:
        try:
            if self._link is None:
                self._link = _connected(self._path)
            socket.send_fds(self._link, [received], [connection], socket.MSG_NOSIGNAL)
        except BlockingIOError:
            return False  # it is behind
        except OSError:
            if self._link is not None:
                self._link.close()
                self._link = None
            return False
        return True


def _connected(path: Path) -> socket.socket:
    link = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK | socket.SOCK_CLOEXEC)
    try:
        link.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4 * MOST_BYTES)
        link.connect(str(path))
    except OSError:
        link.close()
        raise
    return link


def listen(path: Path) -> socket.socket:
    """The stream process's side: a socket that web servers connect to. Raises OSError."""
    path.unlink(missing_ok=True)  # of a process that was killed
    listening = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK | socket.SOCK_CLOEXEC)
    listening.bind(str(path))
    path.chmod(0o600)
    listening.listen(WAITING)
    return listening


def receive(link: socket.socket) -> tuple[socket.socket, bytes] | None:
    """A connection that was handed over and what was read of it; None at the end of the link. Raises BlockingIOError
    when there is none."""
    received, descriptors, _, _ = socket.recv_fds(link, MOST_BYTES, 1)
    if not descriptors:
        return None
    connection = socket.socket(fileno=descriptors[0])
    connection.setblocking(False)
    connection.set_inheritable(False)
    return connection, received
