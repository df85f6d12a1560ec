"""Prepares a site for its programs: tables, static files, tracks and a first season."""

import fcntl
import hashlib
import os
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from datetime import datetime
from functools import partial
from importlib.metadata import version
from pathlib import Path
from time import monotonic
from typing import Any

import django
from django.conf import settings
from django.contrib.staticfiles.finders import get_finders
from django.core.files.storage import default_storage
from django.core.management import call_command
from django.core.management.base import BaseCommand, CommandError, OutputWrapper
from django.db import connection
from django.db.models.signals import pre_migrate

from config.serving import static_files
from core.management.commands import migrate

Progress = Callable[[str], None]
NO_ADMIN = "There is no admin yet. Create one: manage.py setup --admin ALIAS --email ADDRESS"
PROGRESS_EVERY_S = 5.0
_LOCK = 0x7061646F  # the name of our advisory lock in PostgreSQL, any number


def prepare_site(command: BaseCommand, *, now: datetime) -> None:
    """Bring tables, static files and the catalogue up to date, and open the first season where there is none.

    Repeatable, also after an interruption. Two on the same database or data folder take turns. ``command`` prints the
    steps and runs the system checks.
    """
    from league.models import Season
    from league.seasons.services.demo_season import MONTHS, open_demo_season
    from paddock.geometry.catalogue import CATALOGUE
    from tracks.services import load_catalogue

    out = command.stdout
    out.write(f"Data folder: {settings.DATA_DIR}")
    with _turn(out):
        with _step(out, "Migrating the database") as progress:
            _migrate(progress)
        command.check(fail_level=40)
        if settings.STORAGE != "local" and (create := missing_bucket()):
            with _step(out, f"Creating the bucket of {settings.STORAGE}"):
                create()
        if not settings.STATIC_PREPARED:
            sources = _static_sources()
            with _step(out, f"Collecting {len(sources)} static files"):
                _collect(sources)
        with _step(out, f"Loading {len(CATALOGUE)} tracks"):
            load_catalogue(now=now)
        if not Season.objects.exists():
            with _step(out, f"Opening the first season, {MONTHS} months of races"):
                open_demo_season(now=now)


@contextmanager
def _step(out: OutputWrapper, text: str) -> Iterator[Progress]:
    """Print one line: what is done, at times how far it is, and at the end how long it took."""
    begun = printed = monotonic()

    def progress(share: str) -> None:
        nonlocal printed
        if monotonic() - printed >= PROGRESS_EVERY_S:
            printed = monotonic()
            write(f" {share} ...")

    def write(words: str, ending: str = "") -> None:
        out.write(words, ending=ending)
        out.flush()

    write(f"{text} ...")
    took = ""
    try:
        yield progress
        took = f" {monotonic() - begun:.1f} s"
    finally:
        write(took, ending="\n")


@contextmanager
def _turn(out: OutputWrapper) -> Iterator[None]:
    """Hold the data folder and, where machines share the database, its lock. Both go with this process."""
    folder = os.open(settings.DATA_DIR, os.O_RDONLY)
    try:
        try:
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            out.write("Another setup of this data folder is running; waiting for its end.")
            fcntl.flock(folder, fcntl.LOCK_EX)
        if connection.vendor != "postgresql":
            yield
            return
        with closing(connection.copy()) as session, session.cursor() as cursor:
            cursor.execute("SELECT pg_try_advisory_lock(%s)", [_LOCK])
            if not cursor.fetchone()[0]:
                out.write("Another machine is setting up this database; waiting for its end.")
                cursor.execute("SELECT pg_advisory_lock(%s)", [_LOCK])
            yield
    finally:
        os.close(folder)


def _migrate(progress: Progress) -> None:
    planned = applied = 0

    class Migrate(migrate.Command):
        def migration_progress_callback(self, action: str, migration: Any = None, fake: bool = False) -> None:
            nonlocal applied
            if action == "apply_success":
                applied += 1
                progress(f"{applied} of {planned}")

    def count(plan: list[Any], **kwargs: object) -> None:
        nonlocal planned
        planned = len(plan)

    pre_migrate.connect(count)
    try:
        call_command(Migrate(), interactive=False, verbosity=0)
    finally:
        pre_migrate.disconnect(count)


def missing_bucket() -> Callable[[], object] | None:
    """What creates the bucket of STORAGE; None where it exists, or may exist and is closed to us. Raises
    CommandError where the server does not answer."""
    from botocore.exceptions import BotoCoreError, ClientError

    storage: Any = default_storage  # S3Storage, which has no types
    name, client = storage.bucket_name, storage.connection.meta.client
    try:
        client.head_bucket(Bucket=name)
    except ClientError as refused:
        if refused.response["ResponseMetadata"]["HTTPStatusCode"] != 404:
            return None
        region = client.meta.region_name
        there = {} if region in (None, "us-east-1", "aws-global") else {"LocationConstraint": region}
        options = {"CreateBucketConfiguration": there} if there else {}
        return partial(client.create_bucket, Bucket=name, **options)
    except BotoCoreError as problem:
        raise CommandError(f"The storage {settings.STORAGE} does not answer: {problem}") from None
    return None


def _static_sources() -> dict[str, Path]:
    return {name: Path(storage.path(name)) for finder in get_finders() for name, storage in finder.list(None)}


def _collect(sources: dict[str, Path]) -> None:
    """Collect the static files unless the sources and what was collected of them are as after the last time."""
    stamp = settings.DATA_DIR / "static.collected"
    if not stamp.exists() or stamp.read_text() != _collected_state(sources):
        call_command("collectstatic", interactive=False, verbosity=0)
        stamp.write_text(_collected_state(sources))


def _collected_state(sources: dict[str, Path]) -> str:
    made_by = [django.__version__, version("whitenoise"), settings.STATIC_URL, str(settings.STATIC_ROOT)]
    read = [static_files.__file__, *(str(path) for _, path in sorted(sources.items()))]
    read += sorted(f"{folder}/{name}" for folder, _, names in os.walk(settings.STATIC_ROOT) for name in names)
    made_by += [f"{path} {found.st_size} {found.st_mtime_ns}" for path in read for found in [os.stat(path)]]
    return hashlib.sha256("\n".join(made_by).encode()).hexdigest()
