"""A name with a NUL, which PostgreSQL refuses to look for, is not there: on a page as in the API."""

from __future__ import annotations

import pytest
from django.db import DataError, OperationalError
from django.test import Client

from core.validators import is_of_nul
from tests.factories import a_model, a_racer

pytestmark = pytest.mark.django_db
REFUSED = "PostgreSQL text fields cannot contain NUL (0x00) bytes"


@pytest.fixture
def client() -> Client:
    client = Client(raise_request_exception=False)
    client.force_login(a_racer("alice"), backend="django.contrib.auth.backends.ModelBackend")
    return client


@pytest.fixture
def as_postgresql(monkeypatch):
    """Names are looked for as PostgreSQL's driver does it."""
    from django.db.models import CharField

    plain = CharField.get_db_prep_value

    def kept(self, value, connection, prepared=False):
        if isinstance(value, str) and "\0" in value:
            raise DataError(REFUSED)
        return plain(self, value, connection, prepared)

    monkeypatch.setattr(CharField, "get_db_prep_value", kept)


@pytest.mark.parametrize("at", ["/evaluations/a%00b/", "/models/%00/", "/runs/new/?run=%00", "/training/%00/"])
def test_a_page_of_such_a_name_is_not_there(client, as_postgresql, at):
    answer = client.get(at)
    assert answer.status_code == 404 and b"<html" in answer.content


def test_the_api_says_so_too(client, as_postgresql):
    answer = client.get("/api/v1/evaluations/a%00b/")
    assert (answer.status_code, answer.json()["code"]) == (404, "not_found")
    body = {"model": a_model(a_racer("bob")).public_id, "track": "\0"}
    answer = client.post("/api/v1/evaluations/", body, content_type="application/json")
    assert answer.status_code in (400, 403, 404), answer.content


def test_other_failures_of_the_database_stay_what_they_are():
    assert not is_of_nul(OperationalError(REFUSED)) and not is_of_nul(DataError("value too long"))
