"""Writes with If-Match: nobody's change is written over unseen."""

from __future__ import annotations

import gzip
import json

import pytest
from rest_framework.test import APIClient

from config.api.urls import version_1
from core.api.views import APIView
from races.models import Race, Visibility
from tests.api.schema import SCHEMA
from tests.factories import a_race
from tests.soak import some
from training.vehicles.services import save_vehicle

pytestmark = pytest.mark.django_db
STALE = '"0123456789abcdef"'


@pytest.fixture
def race(alice, now) -> str:
    a_race(now, slug="night", organiser=alice)
    return "/api/v1/races/night/"


def test_every_operation_has_the_base_that_checks_conditions():
    views = {route.callback.cls for entry in version_1 for route in getattr(entry, "url_patterns", [entry])}
    assert not [view for view in views if not issubclass(view, APIView)]


class TestIfMatch:
    def test_the_etag_that_was_read_is_accepted_and_the_answer_has_the_next_one(self, race, cast):
        etag = cast["owner"].get(race)["ETag"]
        changed = cast["owner"].patch(race, {"name": "Later"}, headers={"If-Match": etag})
        assert changed.status_code == 200 and changed["ETag"] != etag
        assert cast["owner"].get(race)["ETag"] == changed["ETag"]
        again = cast["owner"].patch(race, {"name": "Latest"}, headers={"If-Match": changed["ETag"]})
        assert again.status_code == 200

    def test_a_stale_etag_is_refused_and_nothing_written(self, race, cast):
        etag = cast["owner"].get(race)["ETag"]
        Race.objects.update(name="By somebody else")
        refused = cast["owner"].patch(race, {"name": "Mine"}, headers={"If-Match": etag})
        assert (refused.status_code, refused.json()["code"]) == (412, "precondition_failed")
        assert Race.objects.get().name == "By somebody else"

    @pytest.mark.parametrize(
        ("header", "status"),
        [
            ("*", 200),
            ("{etag}", 200),
            (STALE + ", {etag}", 200),
            ("{etag} , " + STALE, 200),
            (STALE, 412),
            ("W/{etag}", 412),
            (f"{STALE}, {STALE}", 412),
            ("", 412),
            (",", 412),
            (STALE.strip('"'), 412),
            (STALE + "-gzip", 412),
            (STALE.strip('"') + ", " + "{etag}", 200),
        ],
    )
    def test_lists_and_weak_tags_follow_the_standard(self, race, cast, header, status):
        etag = cast["owner"].get(race)["ETag"]
        answer = cast["owner"].patch(race, {"name": "Else"}, headers={"If-Match": header.format(etag=etag)})
        assert answer.status_code == status

    def test_the_etag_of_a_compressed_answer_is_accepted(self, race, cast):
        read = cast["owner"].get(race, headers={"Accept-Encoding": "gzip"})
        assert read["Content-Encoding"] == "gzip" and not read["ETag"].startswith("W/")
        assert json.loads(gzip.decompress(read.content))["slug"] == "night"
        plain = cast["owner"].get(race)
        assert plain["ETag"] != read["ETag"]
        fresh = cast["owner"].get(race, headers={"If-None-Match": read["ETag"], "Accept-Encoding": "gzip"})
        assert (fresh.status_code, fresh["ETag"]) == (304, read["ETag"])
        for etag, status in ((f"W/{read['ETag']}", 412), (read["ETag"], 200)):
            changed = cast["owner"].patch(race, {"name": "Else"}, headers={"If-Match": etag})
            assert changed.status_code == status

    def test_if_none_match_on_a_write_is_honoured(self, race, cast):
        refused = cast["owner"].patch(race, {"name": "Else"}, headers={"If-None-Match": "*"})
        assert refused.status_code == 412

    def test_an_action_takes_the_etag_of_the_resource_above_it(self, race, cast):
        Race.objects.update(visibility=Visibility.INVITATION)
        etag = cast["owner"].get(race)["ETag"]
        Race.objects.update(name="Else")
        assert cast["owner"].post(f"{race}invitation/", headers={"If-Match": etag}).status_code == 412
        etag = cast["owner"].get(race)["ETag"]
        assert cast["owner"].post(f"{race}invitation/", headers={"If-Match": etag}).status_code == 200

    def test_a_resource_that_does_not_exist_is_not_created(self, alice, cast):
        answer = cast["owner"].patch("/api/v1/vehicles/nothing/", {"name": "x"}, headers={"If-Match": "*"})
        assert answer.status_code == 404

    def test_what_is_refused_anyway_is_refused_as_before(self, race, cast):
        etag = cast["stranger"].get(race)["ETag"]
        answer = cast["stranger"].patch(race, {"name": "x"}, headers={"If-Match": etag})
        assert (answer.status_code, answer.json()["code"]) == (403, "permission_denied")

    def test_a_token_without_the_scope_to_read_may_use_an_etag(self, alice, cast, as_racer):
        vehicle = save_vehicle(owner=alice, name="Evo", sensors=["FRONT_FACING_CAMERA"])
        path = f"/api/v1/vehicles/{vehicle.public_id}/"
        etag = cast["owner"].get(path)["ETag"]
        assert cast["owner"].delete(path, headers={"If-Match": STALE}).status_code == 412
        assert cast["owner"].delete(path, headers={"If-Match": etag}).status_code == 204


CONDITIONAL = [
    (method, path)
    for path, methods in SCHEMA["paths"].items()
    for method, operation in methods.items()
    if any(each["name"] == "If-Match" for each in operation.get("parameters", ()))
]
# nothing there to read in the kept world: the owner has no car for cups, and the race neither duels nor a live event
EMPTY = ("/api/v1/cups/starter/", "/api/v1/races/{slug}/duels/", "/api/v1/races/{slug}/live/")


@pytest.mark.parametrize(("method", "path"), some(CONDITIONAL))
def test_every_operation_that_the_schema_names_checks_the_condition(method, path, fuzzed):
    role = "staff" if path.startswith("/api/v1/programs/") else "owner"
    client, address = APIClient(headers=fuzzed.tokens[role]), fuzzed.fill(path)
    read = client.get(readable(path).format(**fuzzed.names(path)))
    stale = getattr(client, method)(address, {}, headers={"If-Match": STALE})
    if readable(path).startswith(EMPTY):
        assert read.status_code == 404 and stale.status_code >= 400
        return
    assert (read.status_code, stale.status_code, stale.json()["code"]) == (200, 412, "precondition_failed")
    assert getattr(client, method)(address, {}, headers={"If-Match": read["ETag"]}).status_code != 412


def test_nearly_every_write_of_the_schema_takes_a_condition():
    """The others are at addresses that nothing above can be read of."""
    writes = {(method, path) for path, methods in SCHEMA["paths"].items() for method in methods if method != "get"}
    assert {path.removeprefix("/api/v1") for _, path in writes - set(CONDITIONAL)} == {
        "/auth/token/",
        "/invitations/{token}/",
        "/reward-functions/audit/",
        "/reward-functions/validate/",
        "/timing/claims/",
        "/timing/crossings/",
    }


def readable(path: str) -> str:
    """The path, or the nearest one above it with a GET."""
    while "get" not in SCHEMA["paths"].get(path, {}):
        path = path.rstrip("/").rpartition("/")[0] + "/"
    return path
