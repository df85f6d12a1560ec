"""``python -m config.web``: runs the web server in the foreground until SIGTERM or SIGINT."""

import sys

from config.serving.web import main

if __name__ == "__main__":
    sys.exit(main())
