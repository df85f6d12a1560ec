"""Tracks to print: the page with its bill of tape, and the files behind it, for whoever comes by."""

from __future__ import annotations

import pytest
from django.test import Client
from django.utils import timezone

from tests.factories import a_track
from tracks.drawing.printing import FORMS
from tracks.models import Track
from tracks.services import recorded_track

pytestmark = pytest.mark.django_db


@pytest.fixture
def track() -> Track:
    return a_track()


def test_the_page_says_how_much_tape_each_line_takes(track: Track) -> None:
    page = Client().get(f"/tracks/{track.slug}/print/").content.decode()
    for words in ("Outer border", "Inner border", "Dashes in the middle", "76.2 mm"):
        assert words in page
    for form in FORMS:
        assert f'href="/tracks/{track.slug}/print/{form}/"' in page
    assert f'href="/tracks/{track.slug}/print/"' in Client().get(f"/tracks/{track.slug}/").content.decode()


@pytest.mark.parametrize(
    ("form", "kind", "begins"),
    [
        ("svg", "image/svg+xml", b"<?xml"),
        ("pdf", "application/pdf", b"%PDF-"),
        ("dxf", "image/vnd.dxf", b"999\n"),
        ("a4", "application/pdf", b"%PDF-"),
    ],
)
def test_a_file_is_named_after_its_track(track: Track, form: str, kind: str, begins: bytes) -> None:
    answer = Client().get(f"/tracks/{track.slug}/print/{form}/")
    assert (answer.status_code, answer["Content-Type"]) == (200, kind)
    assert answer.content.startswith(begins)
    ending = "-a4.pdf" if form == "a4" else f".{form}"
    assert answer["Content-Disposition"] == f'attachment; filename="{track.slug}{ending}"'


def test_other_forms_and_tracks_are_no_addresses(track: Track) -> None:
    assert Client().get(f"/tracks/{track.slug}/print/a5/").status_code == 404
    assert Client().get("/tracks/nowhere/print/").status_code == 404
    assert Client().get("/tracks/nowhere/print/svg/").status_code == 404
    assert Client().post(f"/tracks/{track.slug}/print/svg/").status_code == 405


def test_the_page_on_the_real_car_is_there_in_both_languages(track: Track) -> None:
    english, korean = (
        Client(headers={"accept-language": language}).get("/learn/real-car/").content.decode()
        for language in ("en", "ko")
    )
    assert "Calibrate first" in english and "먼저 보정하십시오" in korean
    for page in (english, korean):
        for part in ("upload", "calibration", "speed", "differences", "track", "checklist"):
            assert f'<h2 id="{part}">' in page


def test_a_track_without_a_shape_has_nothing_to_print(track: Track) -> None:
    track = recorded_track("Long Gone", now=timezone.now())
    assert "/print/" not in Client().get(f"/tracks/{track.slug}/").content.decode()
    for address in ("print/", *(f"print/{form}/" for form in FORMS)):
        assert Client().get(f"/tracks/{track.slug}/{address}").status_code == 404, address
