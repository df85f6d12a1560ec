"""The schema: complete, honest, and readable as a page."""

from __future__ import annotations

import json
import re
import warnings
from functools import partial

import pytest
import yaml
from django.core.management import call_command
from django.utils.translation import get_language
from drf_spectacular.generators import SchemaGenerator

from config.api import schema_view
from config.api.reference import operations
from config.api.urls import version_1
from config.urls import urlpatterns
from paddock.errors.reasons import REASONS
from tests.api.schema import SCHEMA


def test_the_schema_is_valid_and_generated_without_warnings(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        call_command("spectacular", "--validate", "--fail-on-warn", "--file", str(tmp_path / "schema.yml"))


def test_every_path_and_method_is_described():
    described = {(path, method) for path, item in SCHEMA["paths"].items() for method in item}
    # a room that league does not import has its own list; the state of the site is above the API
    routes = [("/api/v1/", route) for entry in version_1 for route in getattr(entry, "url_patterns", [entry])]
    routes += [("/", route) for route in urlpatterns if str(route.pattern).startswith("api/v1/")]
    offered = {
        (above + re.sub(r"<\w+:(\w+)>", r"{\1}", str(route.pattern)), method)
        for above, route in routes
        for method in ("get", "post", "put", "patch", "delete")
        if hasattr(route.callback.cls, method)
    }
    assert described == offered


def test_every_operation_says_what_it_does_and_how_it_fails():
    for path, item in SCHEMA["paths"].items():
        for method, operation in item.items():
            where = f"{method} {path}"
            assert operation["summary"], where
            assert len(operation["tags"]) == 1, where
            error = operation["responses"]["default"]["content"]["application/json"]["schema"]
            assert error == {"$ref": "#/components/schemas/Error"}, where
            if method != "get":
                assert {"400", "401", "429"} <= set(operation["responses"]), where


def test_no_schema_name_contains_a_number():
    assert not [name for name in SCHEMA["components"]["schemas"] if re.search(r"\d|Output|Input", name)]


def test_the_error_has_the_reason_codes_by_status():
    # generated now: commands that other tests load have registered reasons since
    schemas = SchemaGenerator().get_schema(request=None, public=True)["components"]["schemas"]
    by_status = schemas["Error"]["x-reason-codes"]
    assert {code: int(status) for status, codes in by_status.items() for code in codes} == {
        code: reason.status for code, reason in REASONS.items()
    }


def test_the_schema_is_public(client, db):
    answer = client.get("/api/schema/")
    assert answer.status_code == 200
    assert answer.json()["info"]["title"] == "Paddock"


@pytest.mark.parametrize(
    ("accept", "media_type"),
    [
        ("*/*", "application/json"),
        ("application/vnd.oai.openapi+json", "application/vnd.oai.openapi+json"),
        ("application/vnd.oai.openapi", "application/vnd.oai.openapi"),
        ("application/yaml", "application/yaml"),
    ],
)
def test_the_schema_comes_in_the_accepted_format(client, db, accept, media_type):
    answer = client.get("/api/schema/", HTTP_ACCEPT=accept)
    assert (answer.status_code, answer["Content-Type"].partition(";")[0]) == (200, media_type)
    read = json.loads if "json" in media_type else partial(yaml.load, Loader=yaml.CSafeLoader)
    assert read(answer.content)["paths"].keys() == SCHEMA["paths"].keys()


def test_the_schema_is_generated_once_per_language(client, db, monkeypatch):
    schema_view._generate.cache_clear()
    schema_view.schema_document.cache_clear()
    generated = []
    generate = SchemaGenerator.get_schema
    monkeypatch.setattr(
        SchemaGenerator,
        "get_schema",
        lambda *args, **kwargs: generated.append(get_language()) or generate(*args, **kwargs),
    )
    for language in ("en", "ko", "en", "ko", "de", "../en"):
        assert client.get("/api/schema/", {"lang": language}).status_code == 200
    client.get("/api/docs/")
    assert sorted(generated) == ["en", "ko"]


def test_the_reference_page_loads_nothing_from_other_sites(client, db):
    answer = client.get("/api/docs/")
    assert answer.status_code == 200
    page = answer.content.decode()
    shown = [operation for _subject, rows in operations() for operation in rows]
    assert len(shown) == sum(map(len, SCHEMA["paths"].values()))
    for operation in shown:
        assert f'id="{operation.anchor}"' in page
    assert not re.findall(r'(?:src|href)="(?:https?:)?//', page)
    assert "<style" not in page
    assert " style=" not in page


def test_the_reference_names_every_field_of_a_body():
    upload = next(each for _subject, rows in operations() for each in rows if each.anchor == "upload_model")
    files, words = {"package", "model", "metadata", "weights"}, {"name", "description", "checkpoint"}
    assert {field.name for field in upload.fields} == files | words
    assert {field.kind for field in upload.fields if field.name in files} == {"file"}
    assert upload.body_type == "multipart/form-data"
