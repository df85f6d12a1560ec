"""The download of all data: a racer's own, with their files, and of nobody else."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable
from unittest.mock import patch

import pytest
from django.core.files.base import ContentFile
from django.core.files.storage import default_storage
from django.urls import reverse

from accounts.models import Racer
from accounts.tokens.services import create_token
from core.personal_data.columns import personal_columns
from core.personal_data.exporting import archive, columns_of
from core.personal_data.rules import all_rules
from evaluation.models import Evaluation, Result, TrainedModel
from races.models import Entry
from tests.clients import logged_in
from tests.drawn_runs import a_drawing
from tests.factories import a_model, a_race, a_racer
from tests.kept import Kept
from tests.pages.conftest import World, make_world
from tests.pages.form_world import Cast
from videos import drawing


@pytest.fixture(scope="session")
def kept_cast(request: pytest.FixtureRequest, keep: Callable) -> Kept:
    return keep(request, _with_everything, fresh_s=20.0)  # as of the pages' world


@pytest.fixture
def cast(kept_cast: Kept, db: None) -> World:
    """The world, and in it everything that forms of the site ask for."""
    return kept_cast.copy()


def _with_everything() -> World:
    world = make_world()
    with patch.multiple(drawing, write_video=a_drawing, poster=lambda scene: b"a still"):
        Cast(world)
    return world


def unpacked(pieces) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(b"".join(pieces))) as packed:
        assert packed.testzip() is None
        return {name: packed.read(name) for name in packed.namelist()}


def test_it_has_a_list_of_json_for_each_section_with_rows(cast):
    files = unpacked(archive(Racer.objects.get(alias="alice"), now=cast.now))
    sections = {name.removesuffix(".json") for name in files if name.endswith(".json")}
    known = {rule.section for rule in all_rules().values() if rule.section}
    wanted = {"account", "email_addresses", "models", "trainings", "searches", "entries", "runs", "results", "webhooks"}
    assert wanted <= sections <= known
    assert all(json.loads(files[f"{name}.json"]) for name in sections)
    assert json.loads(files["account.json"])[0]["alias"] == "alice"


def test_the_readme_names_each_section_and_what_is_left_out(cast):
    files = unpacked(archive(Racer.objects.get(alias="alice"), now=cast.now))
    readme = files["README.txt"].decode()
    assert all(f"{rule.section}.json: " in readme for rule in all_rules().values() if rule.section)
    assert all(reason in readme for rule in all_rules().values() for reason in rule.withheld)


def test_nothing_of_another_racer_is_in_it(cast):
    """Alice and bob share races, duels, a team's invitation, a group and runs with both cars."""
    alice, bob = Racer.objects.get(alias="alice"), Racer.objects.get(alias="bob")
    for mine, theirs in ((alice, bob), (bob, alice)):
        files = unpacked(archive(mine, now=cast.now))
        # videos that alice requested name the runs of others, which everybody sees
        texts = [content for name, content in files.items() if name.endswith(".json") and name != "videos.json"]
        text = b"\n".join([*texts, files["README.txt"]]).decode()
        ids = [*Evaluation.objects.filter(owner=theirs), *TrainedModel.objects.filter(owner=theirs)]
        assert ids and theirs.email not in text
        shown = [one.public_id for one in ids if one.public_id in text]
        assert set(shown) <= set(cloned_by(mine))
        traces = set(Result.objects.filter(evaluation__owner=theirs).values_list("trace", flat=True))
        assert traces.isdisjoint(name.removeprefix("files/") for name in files)


def cloned_by(racer: Racer) -> list[str]:
    """Models of others that a racer's own training was begun with."""
    return list(TrainedModel.objects.filter(clones__owner=racer).values_list("public_id", flat=True))


def test_own_files_are_in_it_and_named_by_their_rows(db, now):
    racer = a_racer()
    model = a_model(racer)
    upload = default_storage.save("uploads/mine", ContentFile(b"an upload"))
    network = default_storage.save("networks/mine", ContentFile(b"a network"))
    TrainedModel.objects.filter(pk=model.pk).update(source_file=upload)
    type(model.network).objects.filter(pk=model.network_id).update(onnx=network)
    files = unpacked(archive(racer, now=now))
    assert files[f"files/{upload}"] == b"an upload" and files[f"files/{network}"] == b"a network"
    assert json.loads(files["models.json"])[0]["source_file"] == f"files/{upload}"


def test_a_missing_file_is_named_in_the_readme(db, now):
    racer = a_racer()
    TrainedModel.objects.filter(pk=a_model(racer).pk).update(source_file="uploads/gone")
    assert "uploads/gone" in unpacked(archive(racer, now=now))["README.txt"].decode()


def test_a_sealed_run_is_not_in_it(db, now, wakes):
    racer = a_racer()
    Entry.objects.create(race=a_race(now), racer=racer, entered_at=now)
    run = Evaluation.objects.create(
        owner=racer, model=a_model(racer), track=a_race(now).track, spec={"x": 1}, sealed=True, turn=1
    )
    assert "runs.json" not in unpacked(archive(racer, now=now))
    Evaluation.with_sealed.filter(pk=run.pk).update(sealed=False)
    assert "runs.json" in unpacked(archive(racer, now=now))


def test_no_secret_column_is_exported():
    for rule in all_rules().values():
        if rule.section:
            secret = {name for name in personal_columns(rule.model) if name.endswith(("digest", "secret", "password"))}
            assert secret.isdisjoint(columns_of(rule)), rule.model


def test_a_page_sends_it_some_times_a_day(db, settings):
    settings.DATA_DOWNLOADS_A_DAY = 2
    client = logged_in(a_racer("carol"))
    for _turn in range(2):
        answer = client.post(reverse("data_download"))
        assert "account.json" in unpacked(answer.streaming_content)
        assert answer["Content-Disposition"].startswith('attachment; filename="paddock-carol-')
    assert client.post(reverse("data_download")).url == reverse("own_data")


def test_a_program_gets_it_with_a_token_of_every_scope(db, client, now):
    racer = a_racer()
    for scopes, status in ((("read", "race"), 403), (("read", "race", "train", "organise"), 200)):
        _token, text = create_token(racer=racer, now=now, scopes=scopes)
        answer = client.get("/api/v1/me/data/", headers={"authorization": f"Bearer {text}"})
        assert answer.status_code == status
    assert "account.json" in unpacked(answer.streaming_content)


def test_an_admin_makes_it_for_one_racer_and_the_log_notes_it(db):
    admin, racer = a_racer(is_staff=True, is_superuser=True), a_racer("asked")
    sent = {"action": "download_data", "_selected_action": [racer.pk]}
    answer = logged_in(admin).post("/admin/accounts/racer/", sent)
    assert json.loads(unpacked(answer.streaming_content)["account.json"])[0]["alias"] == "asked"
    assert admin.logentry_set.get().object_id == str(racer.pk)
    sent["_selected_action"] = [racer.pk, admin.pk]
    assert logged_in(admin).post("/admin/accounts/racer/", sent).status_code == 302
