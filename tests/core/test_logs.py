"""Refused requests are one line of the log each."""

from __future__ import annotations

import io
import logging
from collections.abc import Iterator
from copy import deepcopy
from logging.config import dictConfig

import pytest
from django.conf import settings
from django.core.exceptions import BadRequest, PermissionDenied, SuspiciousOperation
from django.http import Http404, HttpRequest, HttpResponse
from django.test import Client
from django.urls import path

from config import urls as site
from tests.factories import a_racer

REFUSALS = {
    "missing": (Http404("gone"), 404),
    "forbidden": (PermissionDenied("no"), 403),
    "bad": (BadRequest("no season"), 400),
    "suspicious": (SuspiciousOperation("too many"), 400),
    "broken": (RuntimeError("our mistake"), 500),
}


def refuse(request: HttpRequest, what: str) -> HttpResponse:
    raise REFUSALS[what][0]


urlpatterns = [path("refuse/<what>/", refuse), *site.urlpatterns]


@pytest.fixture
def log() -> Iterator[io.StringIO]:
    """What the site's own handler writes."""
    written = io.StringIO()
    config = deepcopy(settings.LOGGING)
    config["handlers"]["console"]["stream"] = written
    kept = list(logging.getLogger().handlers)
    dictConfig(config)
    yield written
    logging.getLogger().handlers[:] = kept


@pytest.mark.parametrize("what", REFUSALS)
@pytest.mark.django_db
@pytest.mark.urls("tests.core.test_logs")
def test_only_a_mistake_of_ours_writes_a_traceback(log: io.StringIO, what: str) -> None:
    answer = Client(raise_request_exception=False).get(f"/refuse/{what}/")
    assert answer.status_code == REFUSALS[what][1]
    assert ("Traceback" in log.getvalue()) == (what == "broken")
    assert log.getvalue(), "the request itself is logged"


@pytest.mark.django_db
def test_a_refused_page_of_the_site_is_one_line(log: io.StringIO) -> None:
    client = Client()
    client.force_login(a_racer("alice"), "django.contrib.auth.backends.ModelBackend")
    for address, status in (("/seasons/new/", 403), ("/races/none/", 404), ("/api/v1/races/none/", 404)):
        log.truncate(log.seek(0))
        assert client.get(address).status_code == status
        assert log.getvalue().count("\n") == 1, log.getvalue()
