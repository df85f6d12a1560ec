"""Refuses migrations that break the code before them, which runs beside the new one while a site is upgraded.

    python scripts/lint_migrations.py             look at what is newer than migrations.accepted
    python scripts/lint_migrations.py --accept    take all there are for accepted: with a release, or knowingly

django-migration-linter reads the SQL that PostgreSQL would be given, so a throwaway server is started.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ACCEPTED = Path(__file__).with_name("migrations.accepted")
HOW = (
    "In two steps instead: first what the running code can live with (a new column that may be null or has a "
    "db_default), and with a later release what it no longer needs (docs/operators.md, Upgrade)."
)


def main() -> int:
    """The exit status: 0 when nothing new breaks what runs."""
    sys.path.insert(0, str(ROOT))
    known = all_migrations()
    accepted = accepted_migrations()
    if "--accept" in sys.argv:
        ACCEPTED.open("a").writelines(f"{app} {name}\n" for app, name in known if (app, name) not in accepted)
        return 0
    fresh = [one for one in known if one not in accepted]
    if not fresh:
        print("No migration is newer than those that were accepted.")
        return 0
    return lint(fresh)


def accepted_migrations() -> set[tuple[str, str]]:
    """Those that are listed. Behind a ``#`` stands why one may that the linter would refuse."""
    lines = ACCEPTED.read_text().splitlines() if ACCEPTED.exists() else []
    return {(app, name) for app, name, *_why in (line.split() for line in lines)}


def all_migrations(root: Path = ROOT) -> list[tuple[str, str]]:
    """Application and name of every migration in the checkout, in their order."""
    return sorted((path.parent.parent.name, path.stem) for path in root.glob("*/migrations/[0-9]*.py"))


def lint(migrations: list[tuple[str, str]], extra: dict[str, str] | None = None) -> int:
    """Look at these on a PostgreSQL server of their own. ``extra``: environment of the linter."""
    from tests.postgres import is_installed, postgres

    if not is_installed():
        print("The linter of migrations needs PostgreSQL (Debian: postgresql).", file=sys.stderr)
        return 1
    with postgres() as url, tempfile.NamedTemporaryFile("w", suffix=".txt") as listed:
        listed.write("".join(f"{app}/migrations/{name}.py\n" for app, name in migrations))
        listed.flush()
        found = subprocess.run(
            [
                *(sys.executable, "-m", "django", "lintmigrations", "--no-cache", "--sql-analyser", "postgresql"),
                *("--project-root-path", str(ROOT), "--include-migrations-from", listed.name),
                *("--quiet", "ok", "ignore"),
            ],
            cwd=ROOT,
            env={**os.environ, "DJANGO_SETTINGS_MODULE": "tests.lint_settings", "DATABASE_URL": url, **(extra or {})},
            check=False,
        )
    if found.returncode:
        print(HOW, file=sys.stderr)
    return found.returncode


if __name__ == "__main__":
    sys.exit(main())
