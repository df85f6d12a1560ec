"""Uploading, describing, deleting and racing a model from its pages; importing a track."""

from __future__ import annotations

import io
import re
import zipfile
import zlib
from unittest.mock import Mock

import numpy as np
import pytest
from botocore.exceptions import EndpointConnectionError
from django.core.files.storage import FileSystemStorage
from django.core.files.uploadedfile import SimpleUploadedFile
from django.utils import timezone
from PIL import Image

from evaluation.garage import services as garage_services
from evaluation.garage.services import UploadedModel
from evaluation.models import TrainedModel
from paddock.errors import PlatformFault, UserFault
from paddock.geometry.track import TrackGeometry
from tests.factories import a_model, a_race
from tests.hostile.parts import training_folder
from tests.paddock.packages.coach import coach_graph
from tests.pages.conftest import World
from tests.shared import SHARED, needs_shared
from tracks.models import Track


def upload(client, *files: SimpleUploadedFile, **fields: str):
    """Send the form as a browser does."""
    return client.post("/models/upload/", {"files": list(files), "name": "", "description": "", **fields})


def zipped(**members: bytes) -> bytes:
    """A zip archive."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in members.items():
            archive.writestr(name.replace("__", "."), data)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("name", "data", "code"),
    [
        ("car.tar.gz", b"", "empty"),
        ("car.tar.gz", b"this is no archive", "not_a_model"),
        ("car.zip", zipped(model__onnx=b"\x08\x0a"), "metadata_missing"),
        ("car.zip", zipped(notes__txt=b"hello"), "model_missing"),
        ("car.zip", zipped(model__onnx=b"x")[:-9], "archive_corrupt"),
    ],
)
def test_a_refused_file_is_explained_beside_the_form_with_its_code(world: World, name, data, code: str) -> None:
    client = world.client("newcomer")
    response = upload(client, SimpleUploadedFile(name, data), name="Mine")
    html = response.content.decode()
    assert response.status_code == 422
    assert f'data-code="{code}"' in html
    assert 'value="Mine"' in html, "what was typed stays"
    client.cookies["django_language"] = "ko"
    korean = upload(client, SimpleUploadedFile(name, data)).content.decode()
    assert f'data-code="{code}"' in korean
    assert not TrainedModel.objects.filter(owner=world.newcomer).exists()


@pytest.mark.parametrize(
    "fault", [EndpointConnectionError(endpoint_url="http://bucket"), OSError(28, "full"), zlib.error("check")]
)
def test_an_unavailable_storage_is_reported_with_its_code(world: World, monkeypatch, fault: Exception) -> None:
    monkeypatch.setattr(FileSystemStorage, "_open", Mock(side_effect=fault))
    answer = world.client("alice").get(f"/models/{world.model.public_id}/package.zip")
    assert (answer.status_code, answer["Retry-After"]) == (503, "30")
    assert 'data-code="storage_failed"' in answer.content.decode()


def test_a_missing_file_is_reported_beside_the_field(world: World) -> None:
    response = world.client("newcomer").post("/models/upload/", {"name": ""})
    assert response.status_code == 422
    assert "Choose a model" in response.content.decode()


def test_a_model_is_uploaded_and_shown(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    got: dict = {}

    def keep(*, owner, files, name, description, checkpoint, keep_upload, now):
        got.update(owner=owner, name=name, description=description, sent=[(f.name, f.stream.read()) for f in files])
        return UploadedModel(a_model(world.newcomer, name=name or "model"), created=True)

    monkeypatch.setattr(garage_services, "upload_model", keep)
    files = SimpleUploadedFile("a.onnx", b"net"), SimpleUploadedFile("model_metadata.json", b"{}")
    response = upload(world.client("newcomer"), *files, name="Bolt", description="Fast")
    assert got["sent"] == [("a.onnx", b"net"), ("model_metadata.json", b"{}")]
    assert (got["owner"], got["name"], got["description"]) == (world.newcomer, "Bolt", "Fast")
    page = world.client("newcomer").get(response["Location"]).content.decode()
    assert "Bolt" in page


def test_uploading_the_same_network_leads_to_the_existing_model(world: World, monkeypatch) -> None:
    monkeypatch.setattr(garage_services, "upload_model", lambda **_: UploadedModel(world.model, created=False))
    client = world.client("alice")
    response = upload(client, SimpleUploadedFile("a.onnx", b"net"))
    assert response["Location"] == f"/models/{world.model.public_id}/"
    assert "already in your garage" in client.get(response["Location"]).content.decode()


@pytest.mark.parametrize(
    ("fault", "status"), [(UserFault("garage_full", limit=100), 422), (PlatformFault("upload_busy"), 503)]
)
def test_a_full_garage_and_a_busy_site_have_different_messages(world: World, monkeypatch, fault, status: int) -> None:
    def refuse(**_):
        raise fault

    monkeypatch.setattr(garage_services, "upload_model", refuse)
    response = upload(world.client("alice"), SimpleUploadedFile("a.onnx", b"net"))
    assert response.status_code == status
    assert f'data-code="{fault.code}"' in response.content.decode()


def test_a_model_page_shows_its_network_and_its_runs(world: World) -> None:
    model = world.finished.evaluation.model
    html = world.client("alice").get(f"/models/{model.public_id}/").content.decode()
    assert model.network_id in html
    assert "3 actions" in html and "front camera" in html
    assert html.count('class="fan-ray"') == 3
    assert f"/evaluations/{world.finished.evaluation.public_id}/" in html


def test_a_model_page_shows_what_its_sensors_see(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    html = world.client("alice").get(f"/models/{world.model.public_id}/").content.decode()
    address = f"/models/{world.model.public_id}/sensors.png"
    assert f'src="{address}" alt="What the sensors of this model see (front camera), in three rows' in html
    picture = world.client("alice").get(address)
    assert (picture.status_code, picture["Content-Type"]) == (200, "image/png")
    with Image.open(io.BytesIO(picture.content)) as image:
        assert image.size[0] == 320 and np.asarray(image).std() > 20, "not an empty picture"
    assert "private" in picture["Cache-Control"]
    assert world.client("bob").get(address).status_code == 404

    # drawn once for all models that read the same
    monkeypatch.setattr(
        "evaluation.camera_replay.sensor_pictures.sensor_picture", lambda *_: pytest.fail("drawn again")
    )
    other = a_model(world.alice)
    assert world.client("alice").get(f"/models/{other.public_id}/sensors.png").content == picture.content


def test_a_continuous_action_space_is_drawn_as_an_area(world: World) -> None:
    metadata = world.model.metadata | {
        "action_space_type": "continuous",
        "action_space": {"steering_angle": {"low": -20.0, "high": 25.0}, "speed": {"low": 0.5, "high": 3.0}},
    }
    TrainedModel.objects.filter(pk=world.model.pk).update(metadata=metadata)
    html = world.client("alice").get(f"/models/{world.model.public_id}/").content.decode()
    assert 'class="fan-area"' in html and "-20.0° … 25.0°" in html


def test_a_model_is_offered_races_that_allow_its_sensors(world: World) -> None:
    a_race(world.now, name="Stereo only", slug="stereo", sensors=["STEREO_CAMERAS"])
    html = world.client("alice").get(f"/models/{world.model.public_id}/").content.decode()
    assert "Open race" in html and "Secret race" in html and "Stereo only" not in html
    assert html.count('name="model"') == 5  # one asks for a report


def test_a_model_is_renamed_and_a_taken_name_refused(world: World) -> None:
    client = world.client("alice")
    path = f"/models/{world.model.public_id}/"
    assert client.post(path + "edit/", {"name": "Thunder", "description": "Loud"})["Location"] == path
    world.model.refresh_from_db()
    assert (world.model.name, world.model.description) == ("Thunder", "Loud")
    a_model(world.alice, name="Taken")
    response = client.post(path + "edit/", {"name": "Taken"})
    assert response.status_code == 422 and 'data-code="model_name_taken"' in response.content.decode()


def test_deleting_a_model_keeps_its_results(world: World) -> None:
    client = world.client("alice")
    model = world.finished.evaluation.model
    path = f"/models/{model.public_id}/"
    assert "Results stay on boards." in client.get(path + "delete/").content.decode()
    client.post(path + "delete/")
    assert client.get(path).status_code == 404
    assert model.name not in client.get("/models/").content.decode()
    assert "0:10.000" in client.get("/races/open-race/").content.decode()


def test_the_garage_shows_how_full_it_is_and_is_paginated(world: World) -> None:
    for number in range(55):
        a_model(world.newcomer, name=f"Car number {number}")
    html = world.client("newcomer").get("/models/").content.decode()
    assert "55 of 100" in html and "Page 1 of 2" in html
    assert "Page 2 of 2" in world.client("newcomer").get("/models/?page=2").content.decode()


@needs_shared
def test_a_community_track_is_imported_and_shown_with_its_map(world: World) -> None:
    data = next(SHARED.glob("tracks/**/reInvent2019_wide.npy")).read_bytes()
    client = world.client("bob")
    sent = {"name": "re:Invent wide", "file": SimpleUploadedFile("a.npy", data)}
    response = client.post("/tracks/import/", sent)
    track = Track.objects.get(name="re:Invent wide")
    assert response["Location"] == f"/tracks/{track.slug}/"
    html = client.get(response["Location"]).content.decode()
    assert 'class="track-map"' in html and f"{track.length_m:.2f} m" in html and ">bob<" in html
    assert f'value="{track.slug}" selected' in client.get(f"/races/new/?track={track.slug}").content.decode()


@pytest.mark.parametrize(
    ("data", "code"), [(b"", "track_not_npy"), (b"no array", "track_not_npy"), (b"\x80\x04K\x01.", "track_pickled")]
)
def test_a_refused_track_is_explained_with_its_code(world: World, data: bytes, code: str) -> None:
    sent = {"name": "X", "file": SimpleUploadedFile("a.npy", data)}
    response = world.client("bob").post("/tracks/import/", sent)
    assert response.status_code == 422
    assert f'data-code="{code}"' in response.content.decode()


def test_a_refused_track_is_explained_in_the_visitors_language(world: World) -> None:
    geometry = world.track.geometry
    swapped = TrackGeometry.from_arrays("x", geometry.centre, geometry.inner, geometry.outer)
    rows = np.hstack((swapped.centre, swapped.inner, swapped.outer))
    rows[3, 4:6] = rows[40, 4:6]  # one point of the outer border far down the road
    stream = io.BytesIO()
    np.save(stream, np.vstack((rows, rows[:1])))
    client = world.client("bob")
    client.cookies["django_language"] = "ko"
    sent = {"name": "X", "file": SimpleUploadedFile("a.npy", stream.getvalue())}
    html = client.post("/tracks/import/", sent).content.decode()
    assert re.search(r'data-code="track_\w+"', html)
    assert "border" not in re.search(r'<p data-code="track_.*?</p>', html, re.S)[0]


def test_a_track_page_lists_only_races_visible_to_the_visitor(world: World) -> None:
    names = {
        viewer: set(
            re.findall(
                r">(Open race|Secret race|Old race)</a>", world.client(viewer).get("/tracks/oval/").content.decode()
            )
        )
        for viewer in ("anonymous", "alice")
    }
    assert names["anonymous"] == {"Open race", "Old race"}
    assert names["alice"] == {"Open race", "Old race", "Secret race"}


def test_times_in_the_page_source_are_in_the_sites_time_zone(world: World) -> None:
    html = world.client("anonymous").get("/races/open-race/").content.decode()
    moments = re.findall(r'<time datetime="([^"]+)" data-local>([^<]+)</time>', html)
    assert moments and all(shown.endswith(timezone.get_current_timezone_name()) for _, shown in moments)


def test_a_checkpoint_of_a_training_folder_may_be_chosen(world: World) -> None:
    first, other = (coach_graph(middleware=[8], seed=seed) for seed in (1, 2))
    best = b'{"best_checkpoint": {"name": "4_Step-90.ckpt"}}'
    [(name, folder)] = training_folder({4: first, 9: other}, best, lead="rl-deepracer/")
    client = world.client("newcomer")
    shown = []
    for checkpoint in ("", "9"):
        response = upload(client, SimpleUploadedFile(name, folder), checkpoint=checkpoint)
        assert response.status_code == 302, response.content.decode()
        shown.append(client.get(response.url).content.decode())
    assert "model_4.pb, the best by deepracer_checkpoints.json" in shown[0]
    assert "model_9.pb, as chosen" in shown[1]
    assert all("files ignored" in html and "notes.md" in html for html in shown)
    assert len(set(TrainedModel.objects.filter(owner=world.newcomer).values_list("network", flat=True))) == 2
    refused = upload(client, SimpleUploadedFile(name, folder), checkpoint="<b>5</b>")
    assert 'data-code="checkpoint_missing"' in refused.content.decode()
    assert "<b>5</b>" not in refused.content.decode()
