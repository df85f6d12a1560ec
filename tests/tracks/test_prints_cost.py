"""Files for printing are drawn once, one at a time."""

from __future__ import annotations

import pytest
from django.test import Client

from tracks.drawing import printing
from tracks.services import load_catalogue

pytestmark = pytest.mark.django_db


def test_a_file_is_drawn_once_however_often_it_is_read(monkeypatch):
    load_catalogue()
    drawn, client = [], Client()
    real = printing.drawing_of
    monkeypatch.setattr(printing, "drawing_of", lambda *given: drawn.append(given) or real(*given))
    printing._written.cache_clear()
    for form in printing.FORMS:
        answers = [client.get(f"/tracks/oval/print/{form}/") for _ in range(3)]
        assert {answer.status_code for answer in answers} == {200}
        assert len({answer.content for answer in answers}) == 1 and answers[0].content
        again = client.get(f"/tracks/oval/print/{form}/", headers={"If-None-Match": answers[0]["ETag"]})
        assert again.status_code == 304
    assert len(drawn) == len(printing.FORMS)
    assert client.get("/tracks/bowtie/print/svg/").content != client.get("/tracks/oval/print/svg/").content
