"""What a program says it can read: files are given as what they are, and all else is told in JSON."""

from __future__ import annotations

import re
from io import BytesIO

import pytest
from django.core.cache import cache
from django.utils import timezone

from evaluation.garage import export
from evaluation.garage.services import upload_model
from league.house_cars.services import house_cars
from paddock.packages.read import UploadPart
from tests.api.schema import SCHEMA
from tests.drawn_runs import a_driven_run
from tests.factories import a_race, a_racer, a_track
from tests.hostile.here import launch_here
from tests.live_shows import a_live_race, an_ended_show
from tests.soak import only
from tests.training.jobs import a_trained_one
from videos.services import run_next_video

pytestmark = pytest.mark.django_db
FILES = {
    path: kinds
    for path, methods in SCHEMA["paths"].items()
    if (kinds := set(methods.get("get", {}).get("responses", {}).get("200", {}).get("content", {})))
    and kinds != {"application/json"}
}


@pytest.fixture
def at(alice, video_wakes, as_racer, trainings_taken_on, admitted_here, monkeypatch):
    """Addresses of files that are there; models are written in this process."""
    monkeypatch.setattr(export, "launch", launch_here)
    ids = {}

    def make(room: str) -> str:
        now = timezone.now()
        if room == "evaluations":
            return a_driven_run(a_race(now), alice, now).public_id
        if room == "videos":
            address = f"/api/v1/evaluations/{made('evaluations')}/videos/"
            video = as_racer(alice).post(address).json()["public_id"]
            run_next_video(worker="w")
            return video
        if room == "trainings":
            return a_trained_one(alice, a_track(), now).public_id
        if room == "models":  # it is really written, and kept as it was uploaded
            car = house_cars()[0]
            files = [UploadPart(file.name, BytesIO(file.read_bytes())) for file in (car.onnx, car.metadata)]
            return upload_model(owner=alice, files=files, keep_upload=True, now=now).model.public_id
        if room in ("me", "audit"):
            return ""
        assert room == "races"
        race = a_live_race(now, alice, slug="shown")
        return an_ended_show(now, alice, laps={"bob": (9_000,)}, race=race).race.slug

    def made(room: str) -> str:
        if room not in ids:
            ids[room] = make(room)
        return ids[room]

    def address(path: str) -> str:
        room = path.split("/")[3]
        if room == "races":
            return path.format(slug=made(room), alias="bob")
        return path.format(public_id=made(room), form="csv" if room == "audit" else "car")

    return address


def test_some_operations_answer_with_files():
    assert {"application/pdf", "application/zip", "text/csv", "video/mp4"} <= set().union(*FILES.values())


@pytest.mark.parametrize("path", FILES)
def test_a_file_is_served_for_every_usual_accept_header_and_to_get_alone(alice, as_racer, at, path):
    kind = min(FILES[path], key=lambda one: one != "text/csv")  # the audit log has another one, too
    client = as_racer(a_racer("sam", is_superuser=True, is_staff=True) if "/audit/" in path else alice)
    for accept in (kind, "*/*", f"{kind.partition('/')[0]}/*", "application/json", f"text/html, {kind};q=0.5"):
        cache.clear()  # a download of all data may be asked for a few times a day
        answer = client.get(at(path), headers={"Accept": accept})
        assert (answer.status_code, answer["Content-Type"].partition(";")[0]) == (200, kind), accept
    refused = client.get(at(path), headers={"Accept": "image/png"})
    assert (refused.status_code, refused.json()["code"]) == (406, "not_acceptable")
    for method in ("post", "delete", "put", "patch"):
        answer = getattr(client, method)(at(path), headers={"Accept": kind})
        assert (answer.status_code, answer.json()["code"]) == (405, "method_not_allowed"), "refused in JSON"


ACCEPTS = ("text/csv", "video/mp4", "application/zip", "application/json", "*/*", "no type")


@pytest.mark.parametrize("everywhere", only([False], [False, True]))
def test_an_options_request_never_fails(everywhere, alice, as_racer):
    """Each header at addresses of files, and in turn at those of all others."""
    client = as_racer(alice)
    for number, path in enumerate(SCHEMA["paths"]):
        for accept in ACCEPTS if everywhere or path in FILES else (ACCEPTS[number % len(ACCEPTS)],):
            answer = client.options(re.sub(r"{\w+}", "1", path), headers={"Accept": accept})
            assert answer.status_code in (200, 404, 406), (path, accept, answer.content)
            assert answer["Content-Type"] == "application/json", (path, accept)
            if path in FILES or accept in ("application/json", "*/*"):
                assert answer.status_code != 406, (path, accept)
