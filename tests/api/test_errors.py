"""Every failure has the one form."""

from __future__ import annotations

import json

import pytest
from django.core.exceptions import NON_FIELD_ERRORS, ValidationError
from django.db import OperationalError
from django.test import Client
from django.utils import translation
from rest_framework import exceptions, serializers
from rest_framework.test import APIClient

from core.api.errors import handle
from paddock.errors import PlatformFault, UserFault


def test_a_user_fault_carries_its_code_message_and_values():
    answer = handle(UserFault("model_too_large", limit_mb=32), {})
    assert answer.status_code == 413
    assert answer.data["code"] == "model_too_large"
    assert answer.data["fault"] == "user"
    assert answer.data["params"] == {"limit_mb": 32}
    assert "32 MB" in answer.data["message"]
    assert "fields" not in answer.data


def test_an_upload_over_the_limit_is_not_reported_as_bad_input():
    assert handle(UserFault("too_large", limit_mb=64), {}).status_code == 413


def test_a_platform_fault_is_a_503_with_retry_after():
    answer = handle(PlatformFault("upload_busy"), {})
    assert (answer.status_code, answer.data["fault"]) == (503, "platform")
    assert int(answer["Retry-After"]) > 0


def test_validation_names_nested_fields_with_dots():
    class Point(serializers.Serializer):
        x = serializers.IntegerField()

    class Line(serializers.Serializer):
        name = serializers.CharField(max_length=3)
        points = Point(many=True)

    line = Line(data={"name": "long one", "points": [{"x": 1}, {"x": "?"}]})
    with pytest.raises(exceptions.ValidationError) as caught:
        line.is_valid(raise_exception=True)
    answer = handle(caught.value, {})
    assert (answer.status_code, answer.data["code"]) == (400, "invalid")
    assert set(answer.data["fields"]) == {"name", "points.1.x"}
    assert answer.data["fields"]["name"][0]["code"] == "max_length"
    assert answer.data["message"].startswith("name: ")


def test_an_error_of_the_whole_input_has_an_empty_field_name():
    answer = handle(exceptions.ValidationError("Nothing fits."), {})
    assert answer.data["fields"] == {"": [{"code": "invalid", "message": "Nothing fits."}]}
    assert answer.data["message"] == "Nothing fits."


def test_validation_by_a_django_model_keeps_its_codes():
    error = ValidationError(
        {
            "closes_at": ValidationError("It closes before it opens.", code="race_closes_before_opening"),
            NON_FIELD_ERRORS: ValidationError("Two of a kind.", code="unique_together"),
        }
    )
    fields = handle(error, {}).data["fields"]
    assert fields["closes_at"] == [{"code": "race_closes_before_opening", "message": "It closes before it opens."}]
    assert fields[""][0]["code"] == "unique_together"


def test_an_unreachable_database_is_a_temporary_platform_fault(caplog):
    answer = handle(OperationalError("database is locked"), {})
    assert (answer.status_code, answer.data["code"], answer.data["fault"]) == (503, "unavailable", "platform")
    assert "database is locked" in caplog.text


def test_a_bug_is_logged_and_reveals_no_internals(caplog):
    answer = handle(RuntimeError("secret path /srv/x"), {})
    assert (answer.status_code, answer.data["code"], answer.data["fault"]) == (500, "server_error", "platform")
    assert "secret" not in json.dumps(answer.data)
    assert "secret path" in caplog.text


def test_throttling_says_for_how_long():
    answer = handle(exceptions.Throttled(wait=12.2), {})
    assert (answer.status_code, answer.data["params"], answer["Retry-After"]) == (429, {"wait_s": 13}, "13")


@pytest.mark.parametrize(
    "address", ["/api/", "/api/v1/", "/api/v2/models/", "/api/v1/nothing/here/", "/api/v1/a%0Ab/", "/api/v1/a%00b/"]
)
@pytest.mark.parametrize("method", ["get", "post", "delete", "options", "patch"])
def test_an_unknown_path_gives_404_in_the_error_format(address, method):
    answer = getattr(APIClient(), method)(address)
    assert (answer.status_code, answer.json()["code"]) == (404, "not_found")


def test_a_path_without_its_slash_is_explained_not_redirected():
    answer = APIClient().post("/api/v1/auth/token", {})
    assert answer.status_code == 404
    assert "slash" in answer.data["message"]


@pytest.mark.django_db
@pytest.mark.parametrize(
    ("body", "content_type", "status", "code"),
    [
        ("{", "application/json", 400, "parse_error"),
        ("[" * 100_000, "application/json", 400, "parse_error"),
        ("[]", "application/json", 400, "invalid"),
        ('"text"', "application/json", 400, "invalid"),
        ("null", "application/json", 400, "invalid"),
        ("{}", "application/json", 400, "invalid"),
        ('{"login": {"a": 1}, "password": ["x"]}', "application/json", 400, "invalid"),
        ('{"login": "a\\u0000b", "password": "x"}', "application/json", 400, "invalid"),
        ('{"login": "\\ud800", "password": "x"}', "application/json", 400, "invalid"),
        ("x=1", "application/x-www-form-urlencoded", 415, "unsupported_media_type"),
        ("{}", "application/json; charset=bz2_codec", 400, "parse_error"),
        (" " * 3_000_000, "application/json", 413, "request_too_large"),
    ],
)
def test_invalid_bodies_are_refused_in_the_error_format(body, content_type, status, code):
    answer = Client().generic("POST", "/api/v1/auth/token/", body, content_type=content_type)
    assert (answer.status_code, answer.json()["code"]) == (status, code)


def test_a_body_over_the_upload_limit_is_refused_before_it_is_read(settings):
    settings.UPLOAD_LIMIT_MB = 1
    answer = Client().generic(
        "POST", "/api/v1/models/", b"", "multipart/form-data; boundary=x", CONTENT_LENGTH="3000000"
    )
    assert (answer.status_code, answer.json()["code"]) == (413, "too_large")


@pytest.mark.django_db
def test_an_unsupported_method_is_named(alice, as_racer):
    answer = as_racer(alice).put("/api/v1/me/", {})
    assert (answer.status_code, answer.data["code"]) == (405, "method_not_allowed")


def test_messages_are_in_the_language_of_the_request(monkeypatch):
    monkeypatch.setattr("core.forms.gettext", lambda text: f"<{translation.get_language()}> {text}")
    with translation.override("ko"):
        assert handle(UserFault("empty"), {}).data["message"].startswith("<ko> ")
