"""The track that ``--track`` of a command names: the catalogue's, a file's, or one that was imported into this site."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from django.core.management import call_command
from django.db import OperationalError
from django.utils import timezone

from core.management.base import REFUSED, Refusal
from evaluation.running.pipeline import RaceJob
from league.house_cars.services import house_cars
from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE, by_slug
from paddock.geometry.files import write_npy
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import RaceRules
from races.management.commands import evaluate as command
from tests.evaluation.stubs import outcome_of
from tests.shared import CHECKOUT
from tracks.management.track_lookup import find_track
from tracks.models import Track, TrackLook
from tracks.services import import_track

CAR = house_cars()[0]
CAR_FILES = (str(CAR.onnx), str(CAR.metadata))


@pytest.fixture
def imported(db) -> Track:
    """A track that is in no catalogue, with a look of its own."""
    oval = by_slug("oval").geometry()
    lines = [np.asarray(line) + 5.0 for line in (oval.centre, oval.inner, oval.outer)]
    data = write_npy(TrackGeometry.from_arrays("moved", *lines))
    return import_track(data=data, name="Back yard", owner=None, now=timezone.now(), look=TrackLook.BOLD)


def driven(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> RaceJob:
    """The job that the command would run."""
    jobs = []

    def play(job, **kwargs):
        jobs.append(job)
        return outcome_of()

    monkeypatch.setattr(command, "evaluate", play)
    call_command("evaluate", *CAR_FILES, *arguments, stdout=StringIO())
    (job,) = jobs
    return job


def refused(code: str, name: str) -> Refusal:
    with pytest.raises(Refusal) as caught:
        find_track(name)
    assert caught.value.fault.code == code
    assert caught.value.returncode == REFUSED
    return caught.value


def test_an_imported_track_is_driven_by_its_slug(imported, monkeypatch):
    job = driven(monkeypatch, "--track", "back-yard", "--direction", "cw")
    assert job.track.fingerprint == imported.geometry.in_direction("cw").fingerprint
    assert job.look == "bold"
    assert job.rules == RaceRules(direction="cw")


def test_another_look_of_a_track_can_be_requested(imported, monkeypatch, tmp_path):
    assert driven(monkeypatch, "--track", "back-yard", "--look", "textures").look == "textures"
    assert driven(monkeypatch, "--track", "oval").look == "official"
    file = tmp_path / "copy.npy"
    file.write_bytes(bytes(imported.npy))
    assert driven(monkeypatch, "--track", str(file)).look == "official"


def test_replay_trace_knows_an_imported_track_too(imported, tmp_path):
    with pytest.raises(Refusal) as caught:  # it gets past the track, to the trace that is not there
        call_command("replay_trace", str(tmp_path / "trace.csv"), "--track", "back-yard")
    assert caught.value.fault.code == "file_unreadable"


def test_an_unknown_track_is_refused_with_similar_names(imported):
    fault = refused("track_not_found", "backyard").fault
    assert fault.params["nearest"].split(", ")[0] == "back-yard"
    assert fault.params["known"] == ", ".join(track.slug for track in CATALOGUE)
    assert "back-yard" in str(fault)


@pytest.mark.django_db
@pytest.mark.parametrize("name", ["", "x" * 5000, "a\x00b", "trac\udc80k", "../oval", "ÖVAL", "oval "])
def test_malformed_names_are_unknown_tracks(name):
    refused("track_not_found", name)


def test_a_track_known_only_by_name_is_refused(imported):
    Track.objects.filter(pk=imported.pk).update(length_m=None, width_m=None, corners=None, difficulty=None)
    with pytest.raises(UserFault) as caught:
        find_track("back-yard")
    assert caught.value.code == "track_shape_unknown"
    assert "back-yard" not in refused("track_not_found", "back-yards").fault.params["nearest"]


def test_catalogue_tracks_and_files_need_no_database(tmp_path):
    """Whoever asked it would be stopped here: the test has none."""
    assert find_track("oval").geometry is by_slug("oval").geometry()
    file = tmp_path / "copy.npy"
    file.write_bytes(write_npy(by_slug("oval").geometry()))
    assert find_track(str(file)).geometry.length == pytest.approx(18.0)


def test_an_unreachable_database_is_named_as_the_reason(monkeypatch):
    def away(**kwargs):
        raise OperationalError("connection refused\n\tIs the server running?")

    monkeypatch.setattr(Track.objects, "filter", away)
    fault = refused("track_database", "back-yard").fault
    assert fault.params["problem"] == "connection refused Is the server running?"
    assert "oval" in fault.params["known"]


@pytest.mark.parametrize("address", ["", "postgres://nobody@127.0.0.1:1/nothing"])
def test_an_unknown_track_creates_no_database(address, tmp_path):
    environment = {**os.environ, "PADDOCK_DATA": str(tmp_path / "data"), "DATABASE_URL": address}
    if not address:
        del environment["DATABASE_URL"]
    ran = subprocess.run(
        [sys.executable, "manage.py", "evaluate", *CAR_FILES, "--track", "ovall", "--json"],
        cwd=CHECKOUT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ran.returncode == REFUSED, ran.stderr
    error = json.loads(ran.stdout)["error"]
    assert error["code"] == ("track_database" if address else "track_not_found")
    assert "oval" in error["message"]
    assert not list(Path(tmp_path).rglob("*.sqlite3*"))
    assert "Traceback" not in ran.stderr
