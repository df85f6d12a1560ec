#!/usr/bin/env python
"""Paddock's command line."""

from __future__ import annotations

import gc
import os
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from paddock.errors import PlatformFault


# Commands that load the apps only where they need them (core.management.light)
LIGHT = {"evaluate": "races.management.commands.evaluate"}
_NEED_DJANGO = ("--settings", "--pythonpath")


def main() -> None:
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "config.settings")
    if sys.argv[1:2] == ["run"]:
        from config.operations.listen_address import set_site_url

        gc.disable()  # until the programs start (config.operations.run): nearly all that is loaded stays
        set_site_url(sys.argv[2:])
    else:
        gc.set_threshold(400_000)  # loading makes 175,000 objects that stay; a command ends soon
    if sys.argv[1:] in (["version"], ["--version"]):
        from django import get_version

        print(get_version())
        return
    from django.core.exceptions import ImproperlyConfigured

    try:
        _execute(sys.argv)
    except ImproperlyConfigured as error:  # a wrong value in the environment: a sentence, not a traceback
        if "--traceback" in sys.argv:
            raise
        sys.exit(f"Paddock cannot start: {error}")
    except Exception as error:
        fault = None if "--traceback" in sys.argv else _database_fault(error)
        if fault is None:
            raise
        print(f"{fault.code}: {fault}", file=sys.stderr)
        sys.exit(3)


def _execute(arguments: list[str]) -> None:
    module = LIGHT.get("".join(arguments[1:2]))
    if module and not any(argument.startswith(_NEED_DJANGO) for argument in arguments):
        from core.management.light import run_without_apps
        from paddock.short_lived import leave

        run_without_apps(module, arguments)
        leave(0)
    else:
        from django.core.management import execute_from_command_line

        execute_from_command_line(arguments)


def _database_fault(error: Exception) -> PlatformFault | None:
    """What a command ends with that found no database or no tables; None for what is a bug."""
    from core.management.base import database_fault

    return database_fault(error)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit(130)
