"""``manage.py units``: the programs of this machine as units of systemd."""

from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from config.operations.listen_address import HOST, PORT, port
from config.operations.run import in_fewer_processes, programs
from config.operations.units.installing import install_units
from config.operations.units.rendering import refused, render_units
from core.management.base import JsonCommand


class Command(JsonCommand):
    help = "Write units of systemd for the programs of this machine, and a target that starts them. Needs root."
    requires_system_checks = []

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("programs", nargs="*", metavar="PROGRAM", help="web, worker, …; none: all of them")
        parser.add_argument(
            "--user", default="paddock", metavar="NAME", help="the user of the programs (default: paddock)"
        )
        parser.add_argument("--directory", type=Path, default=Path("/etc/systemd/system"), help="where units are")
        parser.add_argument("--env-file", type=Path, default=Path("/etc/paddock.env"), help="the settings of all")
        parser.add_argument("--host", default=HOST, help="address that web listens on (default: this machine only)")
        parser.add_argument("--port", type=port, default=PORT, help="port that web listens on (default 8000)")
        parser.add_argument("--backups", type=Path, metavar="FOLDER", help="a backup into FOLDER every night, too")
        parser.add_argument("--print", action="store_true", dest="dry", help="print the units and change nothing")

    def handle(self, *, host: str, port: int, user: str, directory: Path, env_file: Path, **options: Any) -> None:
        places = {"user": user, "env_file": env_file, "backups": options["backups"]}
        units = render_units(_chosen(options["programs"], host, port), **places)
        if options["dry"]:
            for name, text in units.items():
                self.stdout.write(f"# {directory / name}\n{text}")
            return
        deleted = install_units(units=units, directory=directory, **places)
        for name in units:
            self.stdout.write(f"{directory / name}")
        for name in deleted:
            self.stdout.write(f"{directory / name} was deleted.")
        self.stdout.write("Now: systemctl daemon-reload && systemctl enable --now paddock.target")


def _chosen(names: list[str], host: str, port: int) -> dict[str, list[str]]:
    """The commands of these programs. Raises UserFault ``units_refused`` for a program that there is not."""
    commands = in_fewer_processes(programs(host, port))
    for name in names:
        if name not in commands:
            raise refused(f"there is no program {name} here, only {', '.join(commands)}")
    return {name: command for name, command in commands.items() if not names or name in names}
