"""The web server: ``python -m config.web``. Waitress in several processes on one socket.

Waitress takes a request whole, and holds an answer until its reader has taken it, in one thread for all connections:
slow connections cost a few kilobytes and no thread of Django's. A supervisor restarts dead processes.
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
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from types import FrameType
from typing import Any

from config.serving.forking import PYTHON, show
from config.serving.supervisor import CANNOT_RUN, Supervisor
from core.logs.lines import FORMATTERS, format_name
from paddock.malloc import set_malloc_options

logger = logging.getLogger("config.web")
APPLICATION = "config.wsgi:application"
PROCESSES, THREADS = 2, 4
BACKLOG = 2048
CONNECTIONS = 8192  # of one process; beyond them new ones wait in the backlog
# A process waits so long for each connection that it has before it takes new ones
TURN_S, LONGEST_TURN_S, TAKEN_AT_ONCE = 0.00005, 0.002, 2
IDLE_S = 60  # a connection without traffic is closed
GRACE_S = 5.0
RECEIVED_BYTES = 128 * 1024
SENT_BYTES = 256 * 1024
HEADER_BYTES = 64 * 1024
# Of an answer that is made piece by piece; files are read as their reader takes them and need no such bound
HELD_BYTES = 64 * 1024 * 1024
KEPT_BYTES = 16 * 1024 * 1024  # freed memory that a process keeps for its next requests


def main(arguments: list[str] | None = None) -> int:
    """Listen, start the processes and keep them alive until SIGTERM or SIGINT. Returns the exit status. SIGHUP replaces
    all processes by new ones, with the code as it is then."""
    parser = argparse.ArgumentParser(prog="python -m config.web", description="The web server of the site.")
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, default=8000)
    parser.add_argument("--processes", type=int, default=PROCESSES)
    parser.add_argument("--threads", type=int, default=THREADS, help="of each process, that run Django")
    parser.add_argument("--application", default=APPLICATION, help=argparse.SUPPRESS)
    parser.add_argument("--listening", type=int, help=argparse.SUPPRESS)  # the socket, for one of the processes
    given = parser.parse_args(arguments)
    log_lines()
    os.umask(0o077)
    if given.listening is not None:
        _serve(socket.socket(fileno=given.listening), given.application, given.threads, ())
        return 0
    try:
        listening = listen(given.host, given.port)
    except OSError as problem:
        logger.error("Cannot listen on %s port %s: %s", given.host, given.port, problem)
        return 1
    listening.set_inheritable(True)
    options = sys.argv[1:] if arguments is None else arguments
    command = [*PYTHON, "config.web", *options, "--listening", str(listening.fileno())]
    work = partial(os.execv, command[0], command)  # a fork would keep the modules, as they were, that we have loaded
    supervisor = Supervisor(replaces_on_sighup=True)
    for _ in range(given.processes):
        supervisor.add("web", work, vital=True, inherited=[listening.fileno()])
    culprit, status = supervisor.run()
    return status if culprit else 0


def add_processes(supervisor: Supervisor, listening: socket.socket, shown_as: Sequence[str]) -> None:
    """Add the processes of the web server to what ``supervisor`` runs. They serve on the socket ``listening``; ``ps``
    shows them as the command ``shown_as``."""
    for _ in range(PROCESSES):
        work = partial(_serve, listening, APPLICATION, THREADS, shown_as)
        supervisor.add("web", work, vital=True, inherited=[listening.fileno()])


def listen(host: str, port: int) -> socket.socket:
    """A socket that listens at an address; ``::`` takes IPv4 along. Raises OSError."""
    family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0][0]
    listening = socket.create_server((host, port), family=family, backlog=BACKLOG, dualstack_ipv6=host == "::")
    # each connection inherits it; left to itself the kernel holds 4 MB for a reader that takes nothing
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SENT_BYTES)
    return listening


def log_lines() -> None:
    """Log in the form of the site's lines until its settings are loaded, where they are not yet."""
    handler = logging.StreamHandler()
    module, _, name = FORMATTERS[format_name()].rpartition(".")
    handler.setFormatter(getattr(import_module(module), name)())
    logging.basicConfig(handlers=[handler])


def _serve(listening: socket.socket, application: str, threads: int, shown_as: Sequence[str]) -> None:
    """The work of one process."""
    if shown_as:
        show(shown_as)
        sys.argv = ["web", *shown_as]  # its name in the log
    many_files()
    for signum in (signal.SIGTERM, signal.SIGINT):
        signal.signal(signum, signal.SIG_DFL)  # while the site loads, which takes seconds
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    module, _, name = application.partition(":")
    try:
        loaded = getattr(import_module(module), name)
    except Exception:  # of the application, of any kind: operators read it in the log
        logger.exception("The site cannot be loaded.")
        sys.exit(CANNOT_RUN)
    prepare_memory()
    _serve_until_signal(loaded, listening, threads)


def prepare_memory() -> None:
    """Prepare the memory of a process that has loaded the site."""
    gc.freeze()  # what is loaded stays: a collection that looked through it would take a tenth of all time
    # clearing new pages for each large query takes a tenth of the time of a page that has one
    set_malloc_options(trim_threshold=KEPT_BYTES, mmap_threshold=KEPT_BYTES)


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
    take_turns(server)
    while not stopping:
        wasyncore.poll2(1.0, connections)
    wasyncore.dispatcher.close(server)  # another server may listen there while this one finishes its requests
    until = time.monotonic() + GRACE_S
    while time.monotonic() < until and any(
        channel.requests or channel.total_outbufs_len for channel in server.active_channels.values()
    ):
        wasyncore.poll2(0.1, connections)


def take_turns(server: Any, sleep: Callable[[float], None] = time.sleep) -> None:
    """Let the process with the fewest connections take new ones first. Processes that race for each often have one and
    three quarters of them, and the readers of the second wait."""
    take = server.handle_accept

    def wait_and_take() -> None:
        sleep(min(TURN_S * len(server.active_channels), LONGEST_TURN_S))
        for _ in range(TAKEN_AT_ONCE):
            take()  # nothing where another process was quicker

    server.handle_accept = wait_and_take


def many_files() -> None:
    """As many connections as the system lets us have; the shell's usual 1,024 would be too few."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = hard if hard != resource.RLIM_INFINITY else 65536
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(wanted, 65536), hard))
