"""How answers travel: ETags, freshness, compression, other sites' scripts, limits and the two words before a token."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import pytest
from django.http import FileResponse, HttpResponse
from django.test import RequestFactory
from django.utils import timezone
from knox.models import AuthToken
from rest_framework.test import APIClient

from config.middleware.http_caching import Compression, ConditionalGet
from league.webhooks.payloads import EVENTS, TEST
from races.models import Race, Visibility
from tests.factories import a_race, a_racer, drive, laps

pytestmark = pytest.mark.django_db
ELSEWHERE = "https://stats.example.org"


@pytest.fixture
def race(db) -> Race:
    now = timezone.now()
    race = a_race(now, slug="open")
    drive(race, a_racer("fast"), laps(10_000, 10_100, 10_200), now)
    return race


FILES = ["/races/open/board.csv", "/races/open/board.json", "/races/open/board.atom"]
ADDRESSES = ["/api/v1/races/", "/api/v1/races/open/board/", *FILES]


class TestUnchangedAnswers:
    @pytest.mark.parametrize("address", ADDRESSES)
    def test_an_unchanged_answer_is_not_sent_again(self, race, client, address):
        first = client.get(address)
        assert first.status_code == 200 and first["ETag"] and first["Cache-Control"].startswith("public, ")
        again = client.get(address, headers={"if-none-match": first["ETag"]})
        assert (again.status_code, again.content) == (304, b"")
        drive(race, a_racer("faster"), laps(9_000, 9_000, 9_000), timezone.now())
        Race.objects.filter(pk=race.pk).update(name="Another")
        changed = client.get(address, headers={"if-none-match": first["ETag"]})
        assert changed.status_code == 200 and changed["ETag"] != first["ETag"]

    def test_an_answer_for_a_racer_is_not_cached_by_proxies(self, race, alice, as_racer, client):
        assert as_racer(alice).get("/api/v1/me/")["Cache-Control"] == "private, no-cache"
        client.force_login(alice)
        answer = client.get("/api/v1/races/open/board/")
        assert answer["Cache-Control"] == "private, no-cache"
        assert {"Authorization", "Cookie", "Accept-Language"} <= set(answer["Vary"].split(", "))

    def test_an_answer_about_a_private_race_is_not_cached_by_proxies(self, race, alice, client):
        Race.objects.filter(pk=race.pk).update(visibility=Visibility.INVITATION, organiser=alice)
        client.force_login(alice)
        for address in FILES:
            assert client.get(address)["Cache-Control"].startswith("private, "), address

    def test_stored_files_have_an_etag_too(self, tmp_path: Path):
        (tmp_path / "a.bin").write_bytes(b"12345")

        def get(**headers: str) -> HttpResponse:
            request = RequestFactory().get("/file", headers=headers)
            return ConditionalGet(lambda _: FileResponse((tmp_path / "a.bin").open("rb")))(request)

        first = get()
        assert b"".join(first.streaming_content) == b"12345"
        assert get(**{"If-None-Match": first["ETag"]}).status_code == 304

    def test_pages_and_health_checks_have_no_etag(self, race, client):
        assert "ETag" not in client.get("/races/open/")
        assert "ETag" not in client.get("/health/live")


class TestCompression:
    def test_a_board_is_compressed_on_request(self, race, client):
        plain = client.get("/api/v1/races/")
        packed = client.get("/api/v1/races/", headers={"accept-encoding": "gzip"})
        assert packed["Content-Encoding"] == "gzip" and "Accept-Encoding" in packed["Vary"]
        assert json.loads(gzip.decompress(packed.content)) == plain.json()
        assert len(packed.content) < len(plain.content)
        again = client.get("/api/v1/races/", headers={"accept-encoding": "gzip", "if-none-match": packed["ETag"]})
        assert again.status_code == 304, "its ETag is a weak one now, and good all the same"

    def test_pages_with_a_csrf_token_are_not_compressed(self, race, client):
        page = client.get("/races/open/", headers={"accept-encoding": "gzip"})
        assert len(page.content) > 1000 and "Content-Encoding" not in page

    def test_answers_to_requests_with_a_cookie_are_not_compressed(self, race, alice, client):
        client.force_login(alice)
        answer = client.get("/api/v1/races/", headers={"accept-encoding": "gzip"})
        assert "Content-Encoding" not in answer

    @pytest.mark.parametrize("kind", ["video/mp4", "application/zip", "text/html; charset=utf-8"])
    def test_other_content_types_are_not_compressed(self, kind):
        request = RequestFactory().get("/", headers={"accept-encoding": "gzip"})
        answer = Compression(lambda _: HttpResponse(b"x" * 5000, content_type=kind))(request)
        assert "Content-Encoding" not in answer


class TestOtherSitesScripts:
    @pytest.mark.parametrize("address", ADDRESSES)
    def test_a_script_of_another_site_may_read(self, race, client, address):
        answer = client.get(address, headers={"origin": ELSEWHERE})
        assert answer["Access-Control-Allow-Origin"] == "*"
        assert "Access-Control-Allow-Credentials" not in answer, "no reader's session opens anything"
        assert "ETag" in answer["Access-Control-Expose-Headers"]

    def test_a_preflight_allows_reading_but_not_writing(self, race, client):
        ask = {"origin": ELSEWHERE, "access-control-request-headers": "authorization"}
        told = client.options("/api/v1/races/", headers={**ask, "access-control-request-method": "GET"})
        assert (told.status_code, told["Access-Control-Allow-Origin"]) == (200, "*")
        assert "Authorization" in told["Access-Control-Allow-Headers"]
        told = client.options("/api/v1/races/", headers={**ask, "access-control-request-method": "POST"})
        assert "Access-Control-Allow-Origin" not in told

    def test_a_script_of_another_site_may_not_read_pages_or_write(self, race, client, alice, as_racer):
        assert "Access-Control-Allow-Origin" not in client.get("/races/open/", headers={"origin": ELSEWHERE})
        answer = as_racer(alice).post("/api/v1/races/", {}, headers={"origin": ELSEWHERE})
        assert "Access-Control-Allow-Origin" not in answer

    def test_the_operator_can_forbid_scripts_of_other_sites(self, race, client, settings):
        settings.CORS = False
        assert "Access-Control-Allow-Origin" not in client.get("/api/v1/races/", headers={"origin": ELSEWHERE})


class TestLimits:
    def test_every_write_reports_its_rate_limits(self, alice, as_racer, monkeypatch):
        from rest_framework.throttling import ScopedRateThrottle

        monkeypatch.setattr(ScopedRateThrottle, "THROTTLE_RATES", {"upload": "3/hour", "write": "2/hour"})
        client = as_racer(alice)
        answers = [client.post("/api/v1/races/", {}) for _ in range(3)]
        assert [answer.status_code for answer in answers] == [400, 400, 429]
        assert [answer["RateLimit-Limit"] for answer in answers] == ["2"] * 3
        assert [answer["RateLimit-Remaining"] for answer in answers] == ["1", "0", "0"]
        assert all(0 < int(answer["RateLimit-Reset"]) <= 3600 for answer in answers)
        assert "RateLimit-Limit" not in client.get("/api/v1/races/"), "reading is not limited"


class TestToken:
    @pytest.mark.parametrize("word", ["Token", "Bearer", "bearer", "BEARER"])
    def test_a_token_follows_either_keyword(self, alice, word):
        client = APIClient()
        client.credentials(HTTP_AUTHORIZATION=f"{word} {AuthToken.objects.create(user=alice)[1]}")
        assert client.get("/api/v1/me/").data["alias"] == alice.alias

    @pytest.mark.parametrize(
        "header", ["Bearer", "Bearer ", "Bearer a b", "Bearer wrong", "Bearer \xff\xfe", "Basic YTpi"]
    )
    def test_an_invalid_token_is_refused(self, db, header):
        client = APIClient()
        client.credentials(HTTP_AUTHORIZATION=header)
        assert client.get("/api/v1/me/").status_code == 401


def test_the_schema_names_both_keywords_and_the_headers(client):
    schema = client.get("/api/schema/").json()
    schemes = schema["components"]["securitySchemes"]
    assert schemes["bearer"] == {"type": "http", "scheme": "bearer"} and "token" in schemes
    operation = schema["paths"]["/api/v1/races/"]
    assert {"token": []} in operation["post"]["security"] and {"bearer": []} in operation["post"]["security"]
    assert {"ETag", "Cache-Control"} <= set(operation["get"]["responses"]["200"]["headers"])
    limits = {"RateLimit-Limit", "RateLimit-Remaining", "RateLimit-Reset"}
    assert limits <= set(operation["post"]["responses"]["201"]["headers"])
    assert limits | {"Retry-After"} <= set(operation["post"]["responses"]["429"]["headers"])
    assert "304" in operation["get"]["responses"]
    assert set(schema["x-webhooks"]) == {*EVENTS, TEST}
    told = schema["x-webhooks"]["run.finished"]["post"]
    assert {one["name"] for one in told["parameters"]} == {"webhook-id", "webhook-timestamp", "webhook-signature"}
