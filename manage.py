#!/usr/bin/env python
"""Paddock's command line."""

import os
import sys


def main() -> None:
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "league.settings")
    from django.core.exceptions import ImproperlyConfigured
    from django.core.management import execute_from_command_line

    try:
        execute_from_command_line(sys.argv)
    except ImproperlyConfigured as error:  # a wrong value in the environment: a sentence, not a traceback
        if "--traceback" in sys.argv:
            raise
        sys.exit(f"Paddock cannot start: {error}")


if __name__ == "__main__":
    main()
