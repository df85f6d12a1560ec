"""Refuses migrations that break the code before them, which runs beside the new one while a site is upgraded, and
released ones that were changed: a site that has run them never sees the change.

    python scripts/lint_migrations.py              look at what is newer than migrations.accepted, and what was released
    python scripts/lint_migrations.py --accept     take all there are for accepted: knowingly
    python scripts/lint_migrations.py --release    the same, with a release: from then on their files never change

django-migration-linter reads the SQL that PostgreSQL would be given, so a throwaway server is started.
"""

from __future__ import annotations

import hashlib
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
    changed = [one for one, released in accepted.items() if released and digest(*one) != released]
    if changed:
        print("Released migrations never change; write a new one:", *(f"{a}.{n}" for a, n in changed), file=sys.stderr)
        return 1
    if "--accept" in sys.argv or "--release" in sys.argv:
        accept(known, release="--release" in sys.argv)
        return 0
    fresh = [one for one in known if one not in accepted]
    if not fresh:
        print("No migration is newer than those that were accepted.")
        return 0
    return lint(fresh)


def accept(migrations: list[tuple[str, str]], *, release: bool) -> None:
    """Add those that are not listed yet; with a release the hash of each file that has none."""
    lines = {tuple(line.split()[:2]): line for line in _lines()}
    for one in migrations:
        line, _, why = lines.get(one, " ".join(one)).partition("#")
        if release and len(line.split()) == 2:
            line = f"{line.rstrip()} {digest(*one)}"
        lines[one] = f"{line.rstrip()}  # {why.strip()}" if why else line.rstrip()
    ACCEPTED.write_text("".join(f"{line}\n" for line in lines.values()))


def accepted_migrations() -> dict[tuple[str, str], str]:
    """Those that are listed, each with the hash that it was released with; ``""`` for one that was not yet. Behind a
    ``#`` stands why one may that the linter would refuse."""
    found = {}
    for line in _lines():
        app, name, *released = line.partition("#")[0].split()
        found[app, name] = released[0] if released else ""
    return found


def digest(app: str, name: str) -> str:
    """The sha-256 of a migration's file; ``""`` where there is none any more."""
    path = ROOT / app / "migrations" / f"{name}.py"
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else ""


def _lines() -> list[str]:
    return ACCEPTED.read_text().splitlines() if ACCEPTED.exists() else []


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
