"""Runs the command as ``python -m paddock.cli`` where its script is not installed."""

import sys

from .main import main

if __name__ == "__main__":
    sys.exit(main())
