"""``python -m config.streams``: runs the stream process in the foreground until SIGTERM or SIGINT."""

import argparse
import logging
import os
import sys

import django


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m config.streams",
        description="Hold the open streams of the site. A web server of this machine hands them over by itself.",
    )
    parser.add_argument("--host", default="127.0.0.1", help="of a port of its own (default: this machine only)")
    parser.add_argument("--port", type=int, default=0, help="a port of its own, for a proxy; 0: none")
    given = parser.parse_args(arguments)
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "config.settings")
    django.setup()
    from django.conf import settings

    from config.serving import broker
    from config.serving.web import listen, many_files

    from .serving.streams.server import serve

    many_files()
    os.umask(0o077)
    logging.getLogger("uvicorn").setLevel(logging.WARNING)
    try:
        broker.make_private(settings.STREAM_SOCKET.parent)
        serve([listen(given.host, given.port)] if given.port else [], settings.STREAM_SOCKET)
    except OSError as problem:
        logging.getLogger("config.streams").error("The streams cannot be served: %s", problem)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
