"""``python -m paddock.cli``: the command, where no script of that name was installed."""

import sys

from .main import main

if __name__ == "__main__":
    sys.exit(main())
