"""A racer's models: what is kept of an upload, names, quotas, deletion."""

from __future__ import annotations

import hashlib
import io
import os
import threading
from datetime import timedelta

import pytest
from django.contrib.auth.models import AnonymousUser
from django.core.files.storage import default_storage
from django.db import IntegrityError, connections

from evaluation import selectors
from evaluation.garage import services as garage
from evaluation.garage.admission import AdmittedPackage
from evaluation.garage.services import delete_model, describe_model, purge_garages, upload_model
from evaluation.models import Evaluation, Network, TrainedModel
from evaluation.running.queue.services import queue_evaluation
from paddock.errors import UserFault
from paddock.network.bound import NetworkFacts
from paddock.packages.metadata import parse_metadata
from paddock.packages.read import UploadPart
from paddock.rules.race import RaceRules
from tests.rows import METADATA, model_row

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def own_files(settings, tmp_path):
    """Files of this test alone."""
    settings.STORAGES = {
        **settings.STORAGES,
        "default": {"BACKEND": "django.core.files.storage.FileSystemStorage", "OPTIONS": {"location": tmp_path}},
    }


@pytest.fixture(autouse=True)
def admitted(monkeypatch):
    """Admit every file as a network made of its bytes, and note with which limits."""
    import json

    asked = []

    def admit(files, limits, *, racer_pk, checkpoint):
        asked.append(limits)
        onnx = b"onnx of " + files[0].stream.read()
        return AdmittedPackage(
            onnx=onnx,
            sha256=hashlib.sha256(onnx).hexdigest(),
            metadata=parse_metadata(json.dumps(METADATA).encode()),
            source_kind="tensorflow",
            source_sha256=hashlib.sha256(b"source").hexdigest(),
            parameters=7,
            macs=9,
            facts=NetworkFacts(bound=1e-6),
        )

    monkeypatch.setattr(garage, "admit", admit)
    return asked


def files(content=b"a", name="Bolt.tar.gz"):
    return [UploadPart(name, io.BytesIO(content))]


def upload(owner, now, content=b"a", file_name="Bolt.tar.gz", **fields):
    return upload_model(owner=owner, files=files(content, file_name), now=now, **fields)


def code_of(refusal):
    return refusal.value.code


class TestUpload:
    def test_it_keeps_the_network_and_its_facts(self, alice, now, admitted, settings):
        settings.UPLOAD_LIMIT_MB = 5
        model, created = (uploaded := upload(alice, now, description="fast")).model, uploaded.created
        assert created
        assert (model.name, model.description, model.owner) == ("Bolt", "fast", alice)
        assert model.sensors == ["FRONT_FACING_CAMERA"]
        assert (model.source_kind, model.created_at) == ("tensorflow", now)
        network = model.network
        with network.onnx.open() as file:
            assert hashlib.sha256(file.read()).hexdigest() == network.sha256
        assert (network.size, network.parameters, network.macs) == (9, 7, 9)
        assert admitted[0].upload_bytes == 5 * 1024 * 1024

    def test_the_same_network_again_gives_the_existing_model(self, alice, now):
        first = upload(alice, now)
        again = upload(alice, now, name="Another name")
        assert again.model == first.model and not again.created
        assert again.model.name == "Bolt"
        assert TrainedModel.objects.count() == 1

    def test_a_network_of_two_racers_is_stored_once(self, alice, bob, now):
        mine, theirs = upload(alice, now), upload(bob, now)
        assert theirs.created and theirs.model != mine.model
        assert theirs.model.network == mine.model.network
        assert network_files(mine.model.network) == [mine.model.network.onnx.name]

    def test_a_deleted_model_uploaded_again_is_a_new_one(self, alice, now):
        first = upload(alice, now).model
        delete_model(model=first, now=now)
        second = upload(alice, now)
        assert second.created and second.model != first
        assert second.model.network == first.network

    def test_a_refused_upload_keeps_nothing(self, alice, now, monkeypatch):
        def refuse(*args, **options):
            raise UserFault("not_a_model")

        monkeypatch.setattr(garage, "admit", refuse)
        before = set(stored_networks())
        with pytest.raises(UserFault):
            upload(alice, now)
        assert not TrainedModel.objects.exists() and not Network.objects.exists()
        assert set(stored_networks()) == before

    def test_simultaneous_uploads_keep_one_file(self, alice, bob, now, monkeypatch):
        store = garage.store

        def somebody_was_faster(name, content):
            model_row(bob, onnx=b"onnx of a")
            return store(name, content)

        monkeypatch.setattr(garage, "store", somebody_was_faster)
        model = upload(alice, now).model
        assert Network.objects.get() == model.network == bob.models.get().network
        assert network_files(model.network) == [model.network.onnx.name]

    def test_an_upload_under_a_taken_name_keeps_nothing(self, alice, now):
        upload(alice, now, b"a", name="Bolt")
        before = set(stored_networks())
        with pytest.raises(UserFault):
            upload(alice, now, b"b", name="Bolt")
        assert Network.objects.count() == 1
        assert set(stored_networks()) == before

    def test_a_network_purged_meanwhile_is_stored_again(self, alice, now, monkeypatch):
        model_row(alice, onnx=b"onnx of a", at=now - timedelta(days=9))
        old = alice.models.get()
        delete_model(model=old, now=now - timedelta(days=9))
        Network.objects.update(created_at=now - timedelta(days=9))
        hold = garage.hold

        def purge_first(owner):
            monkeypatch.setattr(garage, "hold", hold)
            assert purge_garages(now=now) == 1
            hold(owner)

        monkeypatch.setattr(garage, "hold", purge_first)
        model = upload(alice, now).model
        with model.network.onnx.open() as file:
            assert file.read() == b"onnx of a"

    def test_an_upload_whose_row_fails_keeps_no_file(self, alice, now, monkeypatch):
        def broken(*args, **kwargs):
            raise RuntimeError("the database is away")

        monkeypatch.setattr(Network, "save", broken)
        before = set(stored_networks())
        with pytest.raises(RuntimeError):
            upload(alice, now)
        assert set(stored_networks()) == before


class TestQuota:
    def test_a_full_garage_refuses_before_any_work(self, alice, now, settings, admitted):
        settings.MODELS_PER_RACER = 2
        upload(alice, now, b"a")
        upload(alice, now, b"b")
        with pytest.raises(UserFault) as refusal:
            upload(alice, now, b"c")
        assert code_of(refusal) == "garage_full"
        assert "2 models" in str(refusal.value)
        assert len(admitted) == 2

    def test_a_deleted_model_makes_room(self, alice, now, settings):
        settings.MODELS_PER_RACER = 1
        delete_model(model=upload(alice, now, b"a").model, now=now)
        assert upload(alice, now, b"b").created

    def test_another_racers_models_do_not_count(self, alice, bob, now, settings):
        settings.MODELS_PER_RACER = 1
        upload(alice, now, b"a")
        assert upload(bob, now, b"b").created

    def test_deleting_and_uploading_repeatedly_does_not_fill_the_disk(self, alice, now, settings, admitted):
        settings.STORAGE_PER_RACER_MB = 3
        for content in (bytes(2 << 20), bytes(1 << 20)):
            delete_model(model=upload(alice, now, content).model, now=now)
        with pytest.raises(UserFault) as refusal:
            upload(alice, now, b"c")
        assert code_of(refusal) == "storage_full"
        assert "3 MB" in str(refusal.value)
        assert len(admitted) == 2
        assert Network.objects.count() == 2

    def test_purged_models_use_no_storage(self, alice, now, settings):
        settings.STORAGE_PER_RACER_MB = 1
        delete_model(model=upload(alice, now, bytes(1 << 20)).model, now=now)
        later = now + timedelta(days=2)
        purge_garages(now=later)
        assert upload(alice, later, b"b").created

    def test_another_racers_networks_use_no_storage(self, alice, bob, now, settings):
        settings.STORAGE_PER_RACER_MB = 1
        upload(alice, now, bytes(1 << 20))
        assert upload(bob, now, b"b").created

    @pytest.mark.django_db(transaction=True)
    def test_two_simultaneous_uploads_fill_the_last_place_once(self, alice, now, settings, monkeypatch):
        settings.MODELS_PER_RACER = 1
        admit, both = garage.admit, threading.Barrier(2)

        def admit_together(*args, **options):
            both.wait()
            return admit(*args, **options)

        monkeypatch.setattr(garage, "admit", admit_together)
        codes = []

        def go(content):
            try:
                codes.append("created" if upload(alice, now, content).created else "known")
            except UserFault as fault:
                codes.append(fault.code)
            finally:
                connections.close_all()

        threads = [threading.Thread(target=go, args=(content,)) for content in (b"a", b"b")]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert sorted(codes) == ["created", "garage_full"]

    @pytest.mark.django_db(transaction=True)
    def test_the_same_file_uploaded_twice_at_once_is_one_model(self, alice, now, monkeypatch):
        admit, both = garage.admit, threading.Barrier(2)

        def admit_together(*args, **options):
            both.wait()
            return admit(*args, **options)

        monkeypatch.setattr(garage, "admit", admit_together)
        created = []

        def go():
            try:
                created.append(upload(alice, now).created)
            finally:
                connections.close_all()

        threads = [threading.Thread(target=go) for _ in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert sorted(created) == [False, True]
        assert len(network_files(Network.objects.get())) == 1


class TestNames:
    @pytest.mark.parametrize(
        ("file_name", "name"),
        [
            ("Bolt.tar.gz", "Bolt"),
            ("bolt.v2.onnx", "bolt.v2"),
            ("my  car .zip", "my car"),
            ("C:\\cars\\fast one.tgz", "fast one"),
            ("../../etc/cron.d/x", "x"),
            ("a\0b.onnx", "ab"),
            ("\u202egnp.onnx", "gnp"),
            ("<img onerror=x>.onnx", "<img onerror=x>"),
            ("x" * 300 + ".onnx", "x" * 64),
            (".onnx", "model"),
            ("...", "model"),
            ("", "model"),
            ("자동차.onnx", "자동차"),
        ],
    )
    def test_a_model_is_named_after_its_file(self, alice, now, file_name, name):
        assert upload(alice, now, file_name=file_name).model.name == name

    def test_a_second_file_of_the_same_name_gets_a_number(self, alice, bob, now):
        names = [upload(alice, now, content, "x" * 80).model.name for content in (b"a", b"b", b"c")]
        assert names == ["x" * 64, "x" * 62 + " 2", "x" * 62 + " 3"]
        assert upload(bob, now, b"d", "x" * 80).model.name == "x" * 64

    @pytest.mark.parametrize(
        ("name", "code"),
        [("", "model_name_missing"), (" \t\u200b", "model_name_missing"), ("x" * 65, "model_name_too_long")],
    )
    def test_an_invalid_name_is_refused_before_any_work(self, alice, now, name, code, admitted):
        with pytest.raises(UserFault) as refusal:
            upload(alice, now, name=name)
        assert code_of(refusal) == code
        assert not admitted

    def test_a_taken_name_is_refused(self, alice, now):
        upload(alice, now, b"a", name="Bolt")
        with pytest.raises(UserFault) as refusal:
            upload(alice, now, b"b", name=" Bolt ")
        assert code_of(refusal) == "model_name_taken"

    def test_a_model_can_be_renamed_and_described(self, alice, now):
        model = upload(alice, now).model
        describe_model(model=model, name=" Flash\u202e ", description="x\ny")
        model.refresh_from_db()
        assert (model.name, model.description) == ("Flash", "x y")
        describe_model(model=model, name="Flash", description="")  # its own name is no clash

    def test_a_taken_name_or_long_description_is_refused_on_edit(self, alice, now):
        upload(alice, now, b"a", name="Bolt")
        model = upload(alice, now, b"b", name="Flash").model
        with pytest.raises(UserFault) as refusal:
            describe_model(model=model, name="Bolt", description="")
        assert code_of(refusal) == "model_name_taken"
        with pytest.raises(UserFault) as refusal:
            describe_model(model=model, name="Flash", description="x" * 256)
        assert code_of(refusal) == "description_too_long"
        model.refresh_from_db()
        assert (model.name, model.description) == ("Flash", "")

    def test_the_database_refuses_a_second_model_of_the_same_name(self, alice, now):
        model_row(alice, "Bolt", b"a")
        with pytest.raises(IntegrityError):
            model_row(alice, "Bolt", b"b")


class TestGarage:
    def test_only_its_owner_may_use_a_model_until_it_is_deleted(self, alice, bob, now):
        model = upload(alice, now).model
        for racer in (alice, bob, AnonymousUser()):
            assert selectors.can_use_model(racer, model) == (model in selectors.models_of(racer)) == (racer == alice)
        delete_model(model=model, now=now)
        assert model.deleted_at == now
        assert not selectors.can_use_model(alice, model)
        assert not selectors.models_of(alice).exists()

    def test_deleting_twice_keeps_the_first_timestamp(self, alice, now):
        model = upload(alice, now).model
        delete_model(model=model, now=now)
        delete_model(model=model, now=replace_year(now))
        assert model.deleted_at == now

    def test_evaluations_of_a_deleted_model_stay(self, alice, oval, wakes, now):
        model = upload(alice, now).model
        queue_evaluation(owner=alice, model=model, track=oval, rules=RaceRules(), now=now)
        delete_model(model=model, now=now)
        assert Evaluation.objects.get().model == model


class TestPurge:
    def test_an_old_deleted_model_that_never_raced_is_purged(
        self, alice, bob, oval, wakes, now, django_capture_on_commit_callbacks
    ):
        long_ago = now - timedelta(days=2)
        gone, raced, shared, recent, kept = (
            upload(alice, long_ago, content).model for content in (b"a", b"b", b"c", b"d", b"e")
        )
        queue_evaluation(owner=alice, model=raced, track=oval, rules=RaceRules(), now=long_ago)
        upload(bob, long_ago, b"c")
        for model, moment in ((gone, long_ago), (raced, long_ago), (shared, long_ago), (recent, now)):
            delete_model(model=model, now=moment)
        with django_capture_on_commit_callbacks(execute=True):
            assert purge_garages(now=now) == 1
        assert set(alice.models.all()) == {raced, recent, kept}
        assert network_files(gone.network) == []
        for model in (raced, shared, recent, kept):
            assert network_files(model.network) == [model.network.onnx.name]
        assert purge_garages(now=now) == 0

    def test_uploads_left_by_a_killed_web_server_are_removed(self, now, settings, tmp_path):
        settings.FILE_UPLOAD_TEMP_DIR = tmp_path
        left, running, other = (tmp_path / name for name in ("tmpa.upload.zip", "tmpb.upload.gz", "notes.txt"))
        for path, hours in ((left, 48), (running, 1), (other, 48)):
            path.touch()
            os.utime(path, (now.timestamp() - hours * 3600,) * 2)
        purge_garages(now=now)
        assert sorted(tmp_path.iterdir()) == [other, running]


def replace_year(moment):
    return moment.replace(year=moment.year + 1)


def stored_networks():
    return default_storage.listdir("networks")[1] if default_storage.exists("networks") else []


def network_files(network):
    return [f"networks/{name}" for name in stored_networks() if name.startswith(network.sha256)]
