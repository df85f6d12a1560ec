"""``python -m config.metrics``: answers Prometheus on the port of PADDOCK_METRICS_LISTEN, until SIGTERM or SIGINT."""

import logging
import os
import sys

import django


def main() -> int:
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "config.settings")
    django.setup()
    from django.conf import settings

    if settings.METRICS_LISTEN is None:
        logging.getLogger("config.metrics").error("Set PADDOCK_METRICS_LISTEN.")
        return 1
    from config.operations.metrics import serve

    os.umask(0o077)
    host, port = settings.METRICS_LISTEN
    try:
        serve(host, port)
    except OSError as error:
        logging.getLogger("config.metrics").error("Cannot listen on %s port %s: %s", host, port, error)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
