"""Names from strangers, forged requests and other people's things."""

from __future__ import annotations

import pytest
from django.contrib.auth.models import AnonymousUser
from django.core.files.uploadedfile import SimpleUploadedFile
from django.test import Client, override_settings

from accounts.models import Racer
from evaluation.models import Evaluation, TrainedModel
from paddock.geometry.catalogue import CATALOGUE
from paddock.geometry.files import write_npy
from races.models import Entry, Race, Submission
from tests.factories import a_model, drive, laps
from tests.pages.conftest import World
from tests.pages.test_pages import INLINE
from tests.rows import model_row
from tracks.models import Track

SCRIPT = '"><script>alert(1)</script><img src=x onerror=alert(1)>'
RIGHT_TO_LEFT = "\u202egnp.exe\u202c مرحبا"
LONG = "W" * 64


@pytest.mark.parametrize("name", [SCRIPT, RIGHT_TO_LEFT, LONG, "{{ 7|add:7000000 }}{% now 'Y' %}", "&amp;&lt;b&gt;"])
def test_a_hostile_name_is_plain_text_wherever_it_is_shown(world: World, name: str) -> None:
    Race.objects.filter(pk=world.race.pk).update(name=name, description=name)
    Race.objects.filter(pk=world.cancelled.pk).update(name=name, cancel_reason=name)
    Track.objects.filter(pk=world.track.pk).update(name=name, description=name)
    model = model_row(world.alice, onnx=b"hostile")
    TrainedModel.objects.filter(pk=model.pk).update(name=name, description=name)
    submission = drive(world.race, world.alice, laps(9_000, 9_000, 9_000), world.now)
    Evaluation.objects.filter(pk=submission.evaluation_id).update(model=model)
    Entry.objects.filter(race=world.race, racer=world.bob).update(removal_reason=name)
    client = world.client("alice")
    paths = (
        "/",
        "/races/",
        "/races/?show=cancelled",
        "/races/open-race/",
        "/races/open-race/rules/",
        "/races/open-race/runs/",
        "/races/open-race/edit/",
        "/races/open-race/racers/",
        "/races/no-race/",
        "/models/",
        f"/models/{model.public_id}/",
        f"/models/{model.public_id}/edit/",
        f"/models/{model.public_id}/delete/",
        f"/evaluations/{submission.evaluation.public_id}/",
        "/tracks/",
        "/tracks/oval/",
        "/racers/alice/",
    )
    for path in paths:
        html = client.get(path).content.decode()
        assert "<script>alert" not in html and "<img src=x" not in html, path
        assert not INLINE.search(html.replace("onerror=alert(1)&gt;", "")), path
        assert "7000007" not in html, path


def test_metadata_from_a_stranger_is_plain_text(world: World) -> None:
    TrainedModel.objects.filter(pk=world.model.pk).update(
        metadata={
            "sensor": [SCRIPT],
            "action_space_type": "discrete",
            "action_space": [{"steering_angle": 900.0, "speed": -5.0}],
            "training_algorithm": SCRIPT,
        }
    )
    html = world.client("alice").get(f"/models/{world.model.public_id}/").content.decode()
    assert "<script>alert" not in html and "<img src=x" not in html


@pytest.mark.parametrize("alias", ["<b>", "a b", "a/b", "é", "x" * 65, "x", "", "admin", "ALICE"])
def test_a_taken_or_malformed_alias_cannot_sign_up(world: World, alias: str) -> None:
    data = {
        "username": alias,
        "email": "new@example.org",
        "password1": "correct horse 12",
        "password2": "correct horse 12",
    }
    response = world.client("anonymous").post("/accounts/signup/", data)
    assert response.status_code == 200
    assert response.context["form"].errors["username"]
    assert not Racer.objects.filter(email="new@example.org").exists()


def test_somebody_elses_model_cannot_be_seen_changed_or_raced(world: World) -> None:
    bob = world.client("bob")
    path = f"/models/{world.model.public_id}/"
    for action in ("", "edit/", "delete/"):
        assert bob.get(path + action).status_code == 404
    for action in ("edit/", "delete/"):
        assert bob.post(path + action, {"name": "Mine now"}).status_code == 404
    sent = Submission.objects.count()
    response = bob.post("/races/open-race/submit/", {"model": world.model.public_id}, follow=True)
    assert 'data-code="model_not_yours"' in response.content.decode()
    assert Submission.objects.count() == sent
    world.model.refresh_from_db()
    assert world.model.name == "Lightning" and world.model.deleted_at is None


def test_a_stranger_cannot_stop_a_run(world: World) -> None:
    path = f"/evaluations/{world.queued.evaluation.public_id}/stop/"
    assert world.client("bob").post(path).status_code == 404
    assert world.client("anonymous").post(path).status_code == 302
    assert world.evaluation("queued").state == "queued"


def test_a_stranger_cannot_organise_somebody_elses_race(world: World) -> None:
    bob = world.client("bob")
    forged = {"name": "Mine now", "reason": "because", "cancel_reason": "because"}
    for action in ("edit/", "cancel/", "close/", "racers/alice/remove/", "racers/alice/restore/", "invitation/reset/"):
        assert bob.post(f"/races/open-race/{action}", forged).status_code == 404, action
    before = world.race.invitation
    world.race.refresh_from_db()
    assert world.race.name == "Open race"
    assert world.race.cancelled_at is None
    assert world.race.invitation == before


def test_a_form_cannot_set_what_it_does_not_show(world: World) -> None:
    alice = world.client("alice")
    alice.post(
        "/settings/", {"country": "JP", "alias": "root", "is_staff": "on", "is_superuser": "on", "email": "x@y.org"}
    )
    world.alice.refresh_from_db()
    assert world.alice.country == "JP"
    assert (world.alice.alias, world.alice.is_staff, world.alice.is_superuser) == ("alice", False, False)
    response = alice.post("/races/open-race/edit/", {"kind": "league", "division": "pro", "organiser": world.bob.pk})
    assert response.status_code == 422
    world.race.refresh_from_db()
    assert world.race.kind == "community" and world.race.organiser == world.alice


def test_theme_and_language_forms_do_not_redirect_off_site(world: World) -> None:
    client = world.client("anonymous")
    for target in ("https://evil.example/", "//evil.example/", "javascript:alert(1)", "\\\\evil.example"):
        assert client.post("/theme/", {"theme": "dark", "next": target})["Location"] == "/"
        assert "evil" not in client.post("/i18n/setlang/", {"language": "ko", "next": target})["Location"]


def test_a_forged_theme_cookie_is_ignored(world: World) -> None:
    client = world.client("anonymous")
    client.cookies["theme"] = '"><script>'
    assert 'data-theme=""' in client.get("/").content.decode()


def test_a_huge_body_is_refused_before_it_is_read(world: World) -> None:
    class Unread:
        """A body that nobody may touch."""

        def read(self, *args: object) -> bytes:
            raise AssertionError("the body was read")

        readline = read

    def post(path: str, size: int, user: Racer | AnonymousUser = AnonymousUser()):  # noqa: B008  it is nobody
        from django.core.handlers.wsgi import WSGIRequest

        from config.middleware.body_limit import BodyLimit

        environ = {
            "REQUEST_METHOD": "POST",
            "PATH_INFO": path,
            "CONTENT_LENGTH": str(size),
            "CONTENT_TYPE": "multipart/form-data; boundary=x",
            "wsgi.input": Unread(),
            "SERVER_NAME": "testserver",
            "SERVER_PORT": "80",
        }
        request = WSGIRequest(environ)
        request.user = user
        return BodyLimit(lambda request: None)(request)

    refused = post("/theme/", 6 * 1024 * 1024)
    assert refused.status_code == 413
    assert b"too_large" in refused.content
    assert post("/models/upload/", 500 * 1024 * 1024, world.alice) is None
    assert post("/models/upload/", 514 * 1024 * 1024, world.alice).status_code == 413
    assert post("/models/upload/", 60 * 1024 * 1024).status_code == 413, "who is not logged in uploads nothing"


def test_the_limit_on_body_size_is_enabled(settings) -> None:
    assert "config.middleware.body_limit.BodyLimit" in settings.MIDDLEWARE


def test_a_track_file_that_lies_about_its_size_is_refused(world: World) -> None:
    file = SimpleUploadedFile("big.npy", b"\x93NUMPY" + b"0" * (3 * 1024 * 1024))
    response = world.client("bob").post("/tracks/import/", {"name": "Big", "file": file})
    assert response.status_code == 422
    assert 'data-code="track_file_too_large"' in response.content.decode()


def test_a_debug_page_is_never_shown(world: World) -> None:
    client = Client(raise_request_exception=False)
    with override_settings(DEBUG=False):
        from unittest import mock

        with mock.patch("league.home.views.racing_now", side_effect=RuntimeError("secret detail")):
            response = client.get("/")
    assert response.status_code == 500
    html = response.content.decode()
    assert "Something went wrong" in html
    assert "secret detail" not in html and "Traceback" not in html


def test_a_copy_of_a_catalogue_track_cannot_be_imported(world: World) -> None:
    copy = SimpleUploadedFile("oval.npy", write_npy(next(t for t in CATALOGUE if t.slug == "oval").geometry()))
    response = world.client("bob").post("/tracks/import/", {"name": "Mine", "file": copy})
    assert response.status_code == 422
    assert 'data-code="track_known"' in response.content.decode()


def test_a_model_name_cannot_traverse_paths(world: World) -> None:
    model = a_model(world.alice, name="../../etc/passwd")
    response = world.client("alice").get(f"/models/{model.public_id}/")
    assert response.status_code == 200
    assert "../../etc/passwd</h1>" in response.content.decode()
