"""The web server: ``python -m config.web``. Waitress in several processes on one socket.

Waitress takes a request whole, and holds an answer until its reader has taken it, in one thread for all connections:
slow connections cost a few kilobytes and no thread of Django's. The master restarts dead processes.
"""

import argparse
import gc
import logging
import os
import resource
import signal
import socket
import sys
import time
from contextlib import suppress
from importlib import import_module
from types import FrameType
from typing import Any

from core.logs.lines import LogLines

logger = logging.getLogger("config.web")
PROCESSES, THREADS = 2, 4
BACKLOG = 2048
CONNECTIONS = 8192  # of one process; beyond them new ones wait in the backlog
IDLE_S = 60  # a connection without traffic is closed
GRACE_S = 5.0
KILL_S = GRACE_S + 2.0
CANNOT_SERVE = 3  # how a process ends that could not even load the site; the others would not either
_SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
AGAIN_S = 1.0  # a process that died is started again no sooner than this after
RECEIVED_BYTES = 128 * 1024
SENT_BYTES = 256 * 1024
HEADER_BYTES = 64 * 1024
# Of an answer that is made piece by piece; files are read as their reader takes them and need no such bound
HELD_BYTES = 64 * 1024 * 1024


def main(arguments: list[str] | None = None) -> int:
    """Listen, start the processes and keep them alive until SIGTERM or SIGINT. Returns the exit status. SIGHUP replaces
    all processes by new ones, with the code as it is then."""
    parser = argparse.ArgumentParser(prog="python -m config.web", description="The web server of the site.")
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, default=8000)
    parser.add_argument("--processes", type=int, default=PROCESSES)
    parser.add_argument("--threads", type=int, default=THREADS, help="of each process, that run Django")
    parser.add_argument("--application", default="config.wsgi:application", help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    log_lines()
    many_files()
    os.umask(0o077)
    try:
        listening = listen(given.host, given.port)
    except OSError as problem:
        logger.error("Cannot listen on %s port %s: %s", given.host, given.port, problem)
        return 1
    return _Master(listening, given.application, given.processes, given.threads).run()


def listen(host: str, port: int) -> socket.socket:
    """A socket that listens at an address; ``::`` takes IPv4 along. Raises OSError."""
    family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0][0]
    listening = socket.create_server((host, port), family=family, backlog=BACKLOG, dualstack_ipv6=host == "::")
    # each connection inherits it; left to itself the kernel holds 4 MB for a reader that takes nothing
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SENT_BYTES)
    return listening


class _Master:
    def __init__(self, listening: socket.socket, application: str, processes: int, threads: int) -> None:
        self._listening, self._application = listening, application
        self._processes, self._threads = processes, threads
        self._pid = os.getpid()
        self._started: set[int] = set()
        self._next_start = 0.0
        self._replace = False
        self._ending = False
        self._status = 0

    def run(self) -> int:
        for signum in (signal.SIGTERM, signal.SIGINT):
            signal.signal(signum, self._end)
        signal.signal(signal.SIGHUP, self._reload)
        while not self._ending:
            if self._replace:
                self._replace = False
                old, self._started = self._started, set()
                self._start_missing()
                _tell(old, signal.SIGTERM)
            self._start_missing()
            self._reap()
            time.sleep(0.1)
        self._listening.close()
        _tell(self._started, signal.SIGTERM)
        until = time.monotonic() + KILL_S
        while self._reap():
            if time.monotonic() > until:
                _tell(self._started, signal.SIGKILL)
            time.sleep(0.05)
        return self._status

    def _start_missing(self) -> None:
        while len(self._started) < self._processes and time.monotonic() >= self._next_start:
            signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)  # until the new process has its handlers
            pid = os.fork()
            if pid == 0:
                _serve(self._listening, self._application, self._threads, self._pid)
            self._started.add(pid)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)

    def _reap(self) -> bool:
        """Note the processes that ended; whether any lives."""
        while True:
            try:
                pid, status = os.waitpid(-1, os.WNOHANG)
            except ChildProcessError:
                return False
            if pid == 0:
                return True
            if pid in self._started and not self._ending:
                ended = os.waitstatus_to_exitcode(status)
                if ended == CANNOT_SERVE:
                    self._ending, self._status = True, ended
                else:
                    self._next_start = time.monotonic() + AGAIN_S
                    logger.error("A web process ended (status %s); another takes its place.", ended)
            self._started.discard(pid)

    def _end(self, signum: int, frame: object) -> None:
        self._ending = True

    def _reload(self, signum: int, frame: object) -> None:
        self._replace = True


def log_lines() -> None:
    """Log in the form of the site's lines until its settings are loaded, where they are not yet."""
    handler = logging.StreamHandler()
    handler.setFormatter(LogLines())
    logging.basicConfig(handlers=[handler])


def _tell(pids: set[int], signum: int) -> None:
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, signum)


def _serve(listening: socket.socket, application: str, threads: int, master: int) -> None:
    """The work of one process; never returns."""
    from config.serving.forking import end_with_parent

    for signum in (signal.SIGTERM, signal.SIGINT):
        signal.signal(signum, signal.SIG_DFL)  # while the site loads, which takes seconds
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)
    status = CANNOT_SERVE
    try:
        end_with_parent(master, signal.SIGTERM)
        module, _, name = application.partition(":")
        loaded = getattr(import_module(module), name)
        gc.freeze()  # what is loaded stays: a collection that looked through it would take a tenth of all time
        status = 1
        _serve_until_signal(loaded, listening, threads)
        status = 0
    except Exception:  # of the application, of any kind: operators read it in the log, and the master starts another
        logging.getLogger("waitress").exception("a web process failed")
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def _serve_until_signal(application: Any, listening: socket.socket, threads: int) -> None:
    from django.conf import settings
    from waitress import create_server, wasyncore

    from config.serving.request_limits import Channel, largest_body, without_body
    from config.serving.streams.handover import Sender

    logging.getLogger("waitress").setLevel(logging.ERROR)
    logging.getLogger("waitress.queue").setLevel(logging.CRITICAL)  # that requests wait is no news
    connections: dict[int, Any] = {}
    stopping: list[int] = []
    server = create_server(
        without_body(application),
        map=connections,
        _start=False,
        sockets=[listening],
        threads=threads,
        backlog=BACKLOG,
        connection_limit=CONNECTIONS,
        channel_timeout=IDLE_S,
        cleanup_interval=5,
        recv_bytes=RECEIVED_BYTES,
        max_request_header_size=HEADER_BYTES,
        max_request_body_size=largest_body(),
        outbuf_high_watermark=HELD_BYTES,
        ident="",
        clear_untrusted_proxy_headers=False,  # settings say which are believed
        log_socket_errors=False,
    )
    server.channel_class = Channel
    server.streams = Sender(settings.STREAM_SOCKET)
    server.accept_connections()

    def stop(number: int, _frame: FrameType | None) -> None:
        stopping.append(number)
        server.pull_trigger()

    for signum in (signal.SIGTERM, signal.SIGINT):
        signal.signal(signum, stop)
    while not stopping:
        wasyncore.poll2(1.0, connections)
    wasyncore.dispatcher.close(server)  # another server may listen there while this one finishes its requests
    until = time.monotonic() + GRACE_S
    while time.monotonic() < until and any(
        channel.requests or channel.total_outbufs_len for channel in server.active_channels.values()
    ):
        wasyncore.poll2(0.1, connections)


def many_files() -> None:
    """As many connections as the system lets us have; the shell's usual 1,024 would be too few."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = hard if hard != resource.RLIM_INFINITY else 65536
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(wanted, 65536), hard))
