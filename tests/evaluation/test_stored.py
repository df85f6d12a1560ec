"""What is stored is read as it was written, or not at all; damage is found, shown, and healed."""

from __future__ import annotations

import gzip
import io
import json
from contextlib import suppress
from datetime import timedelta
from types import SimpleNamespace

import pytest
from django.core.files.base import ContentFile
from django.core.files.storage import default_storage
from django.core.management import call_command
from django.db import IntegrityError, transaction
from django.test import Client
from django.utils import timezone

from accounts.models import Racer
from evaluation import stored_files as stored
from evaluation.garage import services as garage
from evaluation.garage.admission import AdmittedPackage
from evaluation.models import Damage, Network, StoredFile
from evaluation.running.queue.worker import run_next_evaluation
from evaluation.stored_files import heal_network, read, read_gzip, scrub, store
from paddock.errors import PlatformFault
from paddock.packages.limits import DEFAULT_LIMITS
from paddock.packages.metadata import identity, parse_metadata
from tests.factories import a_race, a_racer, drive, laps
from tests.rows import METADATA, model_row

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def storage(settings, tmp_path):
    options = settings.STORAGES["default"] | {"OPTIONS": {"location": tmp_path}}
    settings.STORAGES = {**settings.STORAGES, "default": options}
    return tmp_path


@pytest.fixture
def admin():
    racer = Racer.objects.create_superuser("admin-of-files", "files@example.org", "correct horse battery")
    client = Client()
    client.force_login(racer, "django.contrib.auth.backends.ModelBackend")
    return client


@pytest.fixture
def ran(wakes):
    """A submission that has driven, with a trace that is stored."""
    now = timezone.now()
    return drive(a_race(now), a_racer(), laps(9_000, 9_000, 9_000), now)


def zero(storage, name: str, start: int = 0, count: int = 16_384) -> None:
    """Let a disk lose some bytes."""
    content = bytearray((storage / name).read_bytes())
    content[start : start + count] = bytes(len(content[start : start + count]))
    (storage / name).write_bytes(content)


def code(call, *arguments) -> str:
    with pytest.raises(PlatformFault) as fault:
        call(*arguments)
    return fault.value.code


def damage_of(name: str) -> str:
    return StoredFile.objects.get(name=name).damage


class TestReading:
    def test_a_stored_file_is_read_as_written(self):
        name = store("traces/one", b"a trace")
        assert read(name) == b"a trace"
        assert StoredFile.objects.get(name=name).size == 7

    @pytest.mark.parametrize("harm", [b"", b"a trac\0", b"a trace and more"])
    def test_an_altered_file_is_refused(self, storage, harm, ran):
        name = ran.evaluation.result.trace.name
        (storage / name).write_bytes(harm)
        assert code(read, name) == "file_damaged"
        assert damage_of(name) == Damage.ALTERED

    def test_a_missing_file_is_refused(self, ran):
        name = ran.evaluation.result.trace.name
        default_storage.delete(name)
        assert code(read, name) == "file_damaged"
        assert damage_of(name) == Damage.MISSING

    def test_a_storage_outage_is_not_reported_as_damage(self, ran, monkeypatch):
        name = ran.evaluation.result.trace.name

        def away(*_arguments):
            raise ConnectionError("the bucket does not answer")

        monkeypatch.setattr(stored, "default_storage", SimpleNamespace(open=away))
        assert code(read, name) == "storage_failed"
        assert code(lambda: scrub(now=timezone.now())) == "storage_failed"
        assert damage_of(name) == ""

    def test_an_unmounted_folder_is_not_reported_as_damage(self, ran, storage):
        name = ran.evaluation.result.trace.name
        (storage / "traces").rename(storage / "elsewhere")
        assert code(read, name) == "storage_failed"
        assert code(lambda: scrub(now=timezone.now())) == "storage_failed"
        assert damage_of(name) == ""

    def test_a_restored_file_is_whole_again(self, storage, ran):
        name = ran.evaluation.result.trace.name
        good = (storage / name).read_bytes()
        zero(storage, name)
        assert code(read, name) == "file_damaged"
        (storage / name).write_bytes(good)
        assert read(name) == good
        assert damage_of(name) == ""

    def test_a_file_without_a_checksum_must_at_least_unpack(self, storage):
        for content in (b"", b"no gzip", gzip.compress(b"cut off, " * 99)[:-9]):
            (storage / "old.gz").write_bytes(content)
            assert code(read_gzip, "old.gz") == "file_damaged"

    def test_an_empty_trace_is_a_503(self, storage, ran, admin):
        address = f"/api/v1/evaluations/{ran.evaluation.public_id}/trace/"
        assert admin.get(address).status_code == 200
        (storage / ran.evaluation.result.trace.name).write_bytes(b"")
        answer = admin.get(address)
        assert (answer.status_code, answer.json()["code"]) == (503, "file_damaged")
        admin.raise_request_exception = False
        page = admin.get(f"/evaluations/{ran.evaluation.public_id}/trace.csv")
        assert page.status_code >= 500

    def test_a_file_whose_checksum_is_not_recorded_is_not_kept(self, storage, monkeypatch):
        def refuse(*_arguments):
            raise IntegrityError

        monkeypatch.setattr(stored, "_note", refuse)
        with pytest.raises(IntegrityError):
            store("traces/one", b"a trace")
        assert not list((storage / "traces").iterdir())


def test_a_network_with_zeroed_bytes_does_not_race(storage, alice, oval, wakes, now):
    from evaluation.models import Evaluation
    from evaluation.running.queue.services import queue_evaluation
    from paddock.rules.race import RaceRules

    onnx = bytes(range(256)) * 200
    model = model_row(alice, onnx=onnx)
    stored._note(model.network.onnx.name, model.network.sha256, len(onnx))
    evaluation = queue_evaluation(owner=alice, model=model, track=oval, rules=RaceRules(), now=timezone.now())
    zero(storage, model.network.onnx.name, start=20_000)
    assert run_next_evaluation(worker="w")
    told = Evaluation.objects.get(pk=evaluation.pk)
    assert "file_damaged" in told.operator_detail
    assert told.state != "finished"
    assert damage_of(model.network.onnx.name) == Damage.ALTERED


class TestScrub:
    def test_it_finds_damage_in_unread_files(self, storage, ran, now):
        network = ran.evaluation.model.network.onnx.name
        stored._note(network, ran.evaluation.model.network.sha256, 1)
        assert scrub(now=now) == {"checked": 2, "damaged": 0}
        trace = ran.evaluation.result.trace.name
        zero(storage, trace, start=20, count=3)
        default_storage.delete(network)
        assert scrub(now=now + timedelta(days=1)) == {"checked": 0, "damaged": 0}
        assert scrub(now=now + timedelta(days=8)) == {"checked": 2, "damaged": 2}
        assert (damage_of(trace), damage_of(network)) == ("altered", "missing")

    def test_it_continues_where_it_stopped(self, now):
        names = [store(f"traces/{number}", b"%d" % number) for number in range(5)]
        seen = []
        for _ in names:
            assert scrub(now=now, budget_s=0)["checked"] == 1
            seen += StoredFile.objects.exclude(checked_at=None).exclude(name__in=seen).values_list("name", flat=True)
        assert sorted(seen) == sorted(names)
        assert scrub(now=now, budget_s=0)["checked"] == 0

    def test_it_checks_damaged_files_daily(self, storage, ran, now):
        trace = ran.evaluation.result.trace.name
        good = (storage / trace).read_bytes()
        zero(storage, trace)
        scrub(now=now)
        assert damage_of(trace) == "altered"
        (storage / trace).write_bytes(good)
        scrub(now=now + timedelta(days=1, minutes=1))
        assert damage_of(trace) == ""

    def test_it_forgets_an_unreferenced_file(self, now):
        name = store("traces/left", b"of a killed worker")
        default_storage.delete(name)
        assert scrub(now=now) == {"checked": 1, "damaged": 0}
        assert not StoredFile.objects.filter(name=name).exists()

    def test_it_checks_a_network_without_a_checksum_by_identity(self, alice, now):
        onnx = b"canonical bytes"
        sha256 = identity(onnx, parse_metadata(json.dumps(METADATA).encode(), DEFAULT_LIMITS))
        good, bad = model_row(alice, "good", onnx=b"x"), model_row(alice, "bad", onnx=b"y")
        for model, content, key in ((good, onnx, sha256), (bad, b"other bytes", "f" * 64)):
            network = Network(sha256=key, size=1, parameters=1, macs=1)
            network.onnx.save(f"{key}.onnx", ContentFile(content), save=False)
            network.save()
            model.network = network
            model.save()
        scrub(now=now)
        assert damage_of(good.network.onnx.name) == ""
        assert damage_of(bad.network.onnx.name) == "altered"


class TestHealing:
    @pytest.fixture
    def model(self, alice):
        model = model_row(alice, onnx=b"canonical" * 5000)
        stored._note(model.network.onnx.name, model.network.sha256, 45_000)
        return model

    @pytest.mark.parametrize("gone", [True, False])
    def test_a_damaged_network_uploaded_again_is_stored_again(self, model, storage, gone, monkeypatch, now):
        old = model.network.onnx.name
        default_storage.delete(old) if gone else zero(storage, old)
        admitted = AdmittedPackage(
            onnx=b"canonical" * 5000,
            sha256=model.network.sha256,
            metadata=parse_metadata(json.dumps(METADATA).encode(), DEFAULT_LIMITS),
            source_kind="onnx",
            source_sha256="0" * 64,
            parameters=1,
            macs=1,
            facts=None,
        )
        monkeypatch.setattr(garage, "admit", lambda *_arguments, **_options: admitted)
        again = garage.upload_model(owner=model.owner, files=[], now=now)
        assert (again.created, again.model) == (False, model)
        model.network.refresh_from_db()
        assert read(model.network.onnx.name) == b"canonical" * 5000
        assert not StoredFile.objects.exclude(damage="").exists()
        assert len(list((storage / "networks").iterdir())) == 1

    def test_a_whole_file_is_left_alone(self, model):
        before = model.network.onnx.name
        assert not heal_network(model.network.sha256, b"canonical" * 5000)
        model.network.refresh_from_db()
        assert model.network.onnx.name == before


class TestDamageShown:
    @pytest.fixture
    def broken(self, storage, ran):
        name = ran.evaluation.result.trace.name
        zero(storage, name)
        assert code(read, name) == "file_damaged"
        return name

    def test_the_workers_page_shows_damage(self, broken, admin):
        assert broken in admin.get("/workers/").content.decode()

    def test_the_admin_site_shows_damage(self, broken, admin):
        assert broken in admin.get("/admin/evaluation/storedfile/?damage__exact=altered").content.decode()

    def test_doctor_shows_damage(self, broken):
        said = io.StringIO()
        with suppress(SystemExit):  # whatever else is missing here
            call_command("doctor", stdout=said)
        assert f"altered {broken}" in " ".join(said.getvalue().split())


def test_recorded_damage_always_has_a_time(now):
    with pytest.raises(IntegrityError), transaction.atomic():
        StoredFile.objects.create(name="x", sha256="0" * 64, size=1, damage="altered")
    with pytest.raises(IntegrityError), transaction.atomic():
        StoredFile.objects.create(name="x", sha256="", size=1)
