"""Tracks through the API."""

from __future__ import annotations

import io

import numpy as np
import pytest
from django.core.files.uploadedfile import SimpleUploadedFile

from paddock.geometry.catalogue import by_slug
from paddock.geometry.files import write_npy
from tests.factories import a_race, drive, laps
from tests.rows import track_row

pytestmark = pytest.mark.django_db
ADDRESS = "/api/v1/tracks/"


def npy(data: bytes) -> SimpleUploadedFile:
    return SimpleUploadedFile("track.npy", data)


def test_every_track_is_public(oval, cast):
    for client in cast.values():
        assert [row["slug"] for row in client.get(ADDRESS).data["results"]] == ["oval"]
        assert client.get(f"{ADDRESS}oval/").data["name"] == "Paddock Oval"
        assert client.get(f"{ADDRESS}no-such-track/").status_code == 404


def test_a_list_of_tracks_needs_few_queries_and_has_no_points(db, as_racer, django_assert_max_num_queries):
    for slug in ("oval", "baja-turnpike", "kuei-raceway"):
        track_row(slug)
    with django_assert_max_num_queries(2):
        rows = as_racer(None).get(ADDRESS).data["results"]
    assert len(rows) == 3
    assert "centre" not in rows[0]


def test_a_track_includes_its_exact_points(oval, as_racer):
    shown = as_racer(None).get(f"{ADDRESS}oval/").json()
    for line in ("centre", "inner", "outer"):
        assert np.array_equal(np.array(shown[line]), getattr(oval.geometry, line))
    assert shown["length_m"] == oval.length_m


def test_a_track_can_be_imported_only_once(alice, bob, oval, as_racer):
    moved = oval.geometry.centre + 5.0
    rows = np.hstack([moved, oval.geometry.inner + 5.0, oval.geometry.outer + 5.0])
    file = io.BytesIO()
    np.save(file, np.vstack([rows, rows[:1]]))
    answer = as_racer(alice).post(
        ADDRESS, {"file": npy(file.getvalue()), "name": "My Oval", "description": "Mine"}, format="multipart"
    )
    assert answer.status_code == 201, answer.data
    assert (answer.data["slug"], answer.data["imported_by"], answer.data["is_catalogue"]) == ("my-oval", "alice", False)
    assert np.allclose(answer.data["centre"], moved)
    again = as_racer(bob).post(ADDRESS, {"file": npy(file.getvalue()), "name": "Same"}, format="multipart")
    assert (again.status_code, again.data["code"]) == (409, "track_known")
    assert again.data["params"]["slug"] == "my-oval"


def test_an_open_track_is_imported_by_whoever_says_that_it_is_one(alice, as_racer):
    file = by_slug("straight-track").npy
    answer = as_racer(alice).post(ADDRESS, {"file": npy(file), "name": "Line"}, format="multipart")
    assert (answer.status_code, answer.data["code"]) == (400, "track_open")
    answer = as_racer(alice).post(ADDRESS, {"file": npy(file), "name": "Line", "is_open": "true"}, format="multipart")
    assert answer.status_code == 201
    assert answer.data["is_open"] and answer.data["centre"][0] != answer.data["centre"][-1]


@pytest.mark.parametrize(
    ("data", "name", "status", "code"),
    [
        (b"", "Track", 400, "track_not_npy"),
        (b"hello", "Track", 400, "track_not_npy"),
        (bytes(2 * 1024 * 1024 + 1), "Track", 413, "track_file_too_large"),
        (None, "x" * 65, 400, "track_name"),
    ],
)
def test_a_refused_track_says_why(alice, oval, as_racer, data, name, status, code):
    file = npy(write_npy(oval.geometry) if data is None else data)
    answer = as_racer(alice).post(ADDRESS, {"file": file, "name": name}, format="multipart")
    assert (answer.status_code, answer.data["code"]) == (status, code)


def test_importing_needs_a_log_in(oval, as_racer):
    answer = as_racer(None).post(ADDRESS, {"file": npy(b"x"), "name": "Track"}, format="multipart")
    assert (answer.status_code, answer.data["code"]) == (401, "not_authenticated")


def test_tracks_are_searched_by_name_address_and_official_name(db, as_racer):
    for slug in ("oval", "baja-turnpike", "kuei-raceway"):
        track_row(slug)
    client = as_racer(None)
    for words, found in (("Kuei", ["kuei-raceway"]), ("turnp", ["baja-turnpike"]), ("dubai", ["baja-turnpike"])):
        assert [row["slug"] for row in client.get(ADDRESS, {"search": words}).data["results"]] == found
    assert client.get(ADDRESS, {"search": "monza"}).data["results"] == []


def test_tracks_are_sorted_by_a_figure_and_by_no_other(db, as_racer):
    for slug in ("kuei-raceway", "oval", "baja-turnpike"):
        track_row(slug)
    client = as_racer(None)

    def by(name):
        return [row["slug"] for row in client.get(ADDRESS, {"sort": name}).data["results"]]

    assert by("length") == ["oval", "baja-turnpike", "kuei-raceway"]
    assert by("corners") == ["oval", "kuei-raceway", "baja-turnpike"]
    assert by("name") == ["baja-turnpike", "kuei-raceway", "oval"]
    refused = client.get(ADDRESS, {"sort": "colour"})
    assert refused.status_code == 400


def test_a_track_shows_its_record_and_how_often_it_was_raced(alice, bob, as_racer, now):
    race = a_race(now, slug="on-the-oval")
    a_race(now, slug="called-off", track=race.track, cancelled_at=now)
    a_race(now, slug="private", track=race.track, visibility="invitation")
    drive(race, alice, laps(9000, 8000, 8500), now)
    drive(race, bob, laps(7000, 7500, 7900), now)
    figures = as_racer(None).get(f"{ADDRESS}{race.track.slug}/").data["figures"]
    assert figures == {"record": 7000, "record_reverse": None, "raced": 1}
    assert as_racer(None).get(ADDRESS, {"sort": "raced"}).data["results"][0]["figures"] == figures
