"""Launches that must be refused: forged, replayed, foreign, malformed, and what they must not reach."""

from __future__ import annotations

import time
from functools import cache as cache_of_process
from typing import Any
from urllib.parse import urlsplit

import jwt
import pytest
from django.core.cache import cache
from django.test import Client

from accounts.models import Racer
from courses.models import LtiAccount, LtiPlatform
from tests.courses.lti.launching import SITE, begin, launched, refused, send
from tests.courses.lti.platform import CLAIM, new_key, running_platform

pytestmark = pytest.mark.django_db
other_key = cache_of_process(new_key)


@pytest.fixture(autouse=True)
def _nobody_comes(course):
    """Nothing of these launches leaves an account."""
    racers, accounts = Racer.objects.count(), LtiAccount.objects.count()
    yield
    assert (Racer.objects.count(), LtiAccount.objects.count()) == (racers, accounts)


class TestSignature:
    def test_a_forged_signature(self, platform):
        assert refused(send(Client(), platform, "s-1", key=other_key())) == "lti_token"

    def test_a_changed_body(self, platform):
        client = Client()
        asked = begin(client, platform, "s-1")
        mine = platform.signed(platform.claims("s-1", asked["nonce"]))
        theirs = platform.signed(platform.claims("t-1", asked["nonce"]))
        head, _body, signature = mine.split(".")
        token = ".".join([head, theirs.split(".")[1], signature])
        answer = client.post("/lti/launch/", {"id_token": token, "state": asked["state"]})
        assert refused(answer) == "lti_token"

    @pytest.mark.parametrize("algorithm", ["none", "HS256", "RS512", "PS256"])
    def test_another_algorithm(self, platform, algorithm):
        """HS256 with the public key as its secret is what a library falls for that takes the token's word."""
        client = Client()
        asked = begin(client, platform, "s-1")
        body, key = platform.claims("s-1", asked["nonce"]), platform.jwks()["keys"][0]["n"]
        made = {"none": {"key": None}, "HS256": {"key": key}}.get(algorithm, {})
        token = platform.signed(body, algorithm=algorithm, **made)
        answer = client.post("/lti/launch/", {"id_token": token, "state": asked["state"]})
        assert refused(answer) == "lti_token"

    def test_an_unknown_key(self, platform):
        assert refused(send(Client(), platform, "s-1", headers={"kid": "other"})) == "lti_token"

    def test_no_key_named(self, platform):
        assert refused(send(Client(), platform, "s-1", headers={})) == "lti_token"

    def test_keys_are_asked_for_once_a_minute_at_most(self, platform):
        before = platform.fetched
        for _number in range(4):
            send(Client(), platform, "s-1", headers={"kid": "other"})
        assert platform.fetched == before + 1

    def test_a_key_set_with_a_shared_secret(self, platform, monkeypatch):
        """A platform may publish what it likes: only RSA keys are taken."""
        cache.clear()
        secret = {"kty": "oct", "k": "c2VjcmV0", "kid": platform.kid, "alg": "HS256"}
        monkeypatch.setattr(platform, "jwks", lambda: {"keys": [secret]})
        assert refused(send(Client(), platform, "s-1", algorithm="HS256", key="secret")) == "lti_token"

    @pytest.mark.parametrize(
        "keys", [{}, [], {"keys": None}, {"keys": [1]}, {"keys": [{"kty": "RSA", "kid": "key-1"}]}]
    )
    def test_a_malformed_key_set(self, platform, monkeypatch, keys):
        cache.clear()
        monkeypatch.setattr(platform, "jwks", lambda: keys)
        assert refused(send(Client(), platform, "s-1")) == "lti_token"


class TestClaims:
    @pytest.mark.parametrize(
        ("claims", "code"),
        [
            ({"aud": "another-tool"}, "lti_platform_unknown"),
            ({"aud": ["another-tool", "paddock-1"]}, "lti_platform_unknown"),
            ({"aud": ["paddock-1", "another-tool"]}, "lti_token"),
            ({"azp": "another-tool"}, "lti_token"),
            ({"aud": {"a": 1}}, "lti_platform_unknown"),
            ({"iss": "https://elsewhere.example.org"}, "lti_platform_unknown"),
            ({"iss": ["https://elsewhere.example.org"]}, "lti_platform_unknown"),
            ({"exp": -100}, "lti_token"),
            ({"exp": None}, "lti_token"),
            ({"iat": 3600}, "lti_token"),
            ({"iat": None}, "lti_token"),
            ({"sub": None}, "lti_token"),
            ({"sub": 7}, "lti_token"),
            ({"sub": "s" * 256}, "lti_message"),
            ({"nonce": None}, "lti_expired"),
            ({"nonce": "guessed"}, "lti_expired"),
            ({"nonce": {"a": 1}}, "lti_expired"),
            ({f"{CLAIM}deployment_id": "deployment-2"}, "lti_deployment"),
            ({f"{CLAIM}deployment_id": None}, "lti_deployment"),
            ({f"{CLAIM}deployment_id": ["deployment-1"]}, "lti_deployment"),
            ({f"{CLAIM}version": "1.1"}, "lti_message"),
            ({f"{CLAIM}message_type": "LtiSubmissionReviewRequest"}, "lti_message"),
            ({f"{CLAIM}message_type": "Other"}, "lti_message"),
            ({f"{CLAIM}resource_link": "link"}, "lti_message"),
            ({f"{CLAIM}context": None}, "lti_no_course"),
            ({f"{CLAIM}context": {"id": ["course-7"]}}, "lti_message"),
            ({f"{CLAIM}context": {"id": "c" * 256}}, "lti_message"),
            ({"name": "n" * 70_000}, "lti_token"),
        ],
        ids=str,
    )
    def test_a_wrong_claim(self, platform, claims, code):
        """``exp`` and ``iat``: in seconds from now, so that the name of a test is the same in every process."""
        now = int(time.time())
        sent = {name: value + now if name in ("exp", "iat") and value else value for name, value in claims.items()}
        assert refused(send(Client(), platform, "s-1", sent)) == code

    @pytest.mark.parametrize("token", ["", "a", "a.b.c", "W10.W10.W10", "bnVsbA.bnVsbA.bnVsbA", "....", "é.é.é"])
    def test_no_token(self, platform, token):
        client = Client()
        asked = begin(client, platform, "s-1")
        answer = client.post("/lti/launch/", {"id_token": token, "state": asked["state"]})
        assert refused(answer) in ("lti_token", "lti_expired")


class TestReplays:
    def test_a_replayed_launch(self, platform):
        client = Client()
        asked = begin(client, platform, "t-1")
        sent = {"id_token": platform.signed(platform.claims("t-1", asked["nonce"])), "state": asked["state"]}
        assert client.post("/lti/launch/", sent).status_code == 303
        assert refused(client.post("/lti/launch/", sent)) == "lti_expired"

    def test_a_used_state_with_a_new_token(self, platform):
        client = Client()
        asked = begin(client, platform, "t-1")
        send_with = lambda nonce: client.post(  # noqa: E731
            "/lti/launch/", {"id_token": platform.signed(platform.claims("t-1", nonce)), "state": asked["state"]}
        )
        assert refused(send_with("other")) == "lti_expired"
        assert refused(send_with(asked["nonce"])) == "lti_expired"

    def test_the_nonce_of_another_log_in(self, platform):
        client = Client()
        first, second = begin(client, platform, "t-1"), begin(client, platform, "t-1")
        token = platform.signed(platform.claims("t-1", first["nonce"]))
        answer = client.post("/lti/launch/", {"id_token": token, "state": second["state"]})
        assert refused(answer) == "lti_expired"

    def test_the_launch_of_another_browser(self, platform):
        """Somebody's own launch, sent by a page of theirs, logs nobody else in."""
        asked = begin(Client(), platform, "t-1")
        token = platform.signed(platform.claims("t-1", asked["nonce"]))
        answer = Client().post("/lti/launch/", {"id_token": token, "state": asked["state"]})
        assert refused(answer) == "lti_expired"

    def test_an_arrival_is_used_up(self, platform):
        client, _answer = launched(platform, "t-1")
        assert refused(client.get("/lti/arrival/")) == "lti_expired"

    def test_a_cookie_that_was_kept_is_worth_nothing(self, platform):
        client = Client()
        send(client, platform, "t-1")
        key = client.cookies["lti-arrival"].value
        client.get("/lti/arrival/")
        other = Client()
        other.cookies["lti-arrival"] = key
        assert refused(other.get("/lti/arrival/")) == "lti_expired"
        assert "_auth_user_id" not in other.session

    def test_a_log_in_lasts_five_minutes(self, platform, monkeypatch):
        client = Client()
        asked = begin(client, platform, "t-1")
        later = time.time() + 301
        monkeypatch.setattr("django.core.cache.backends.locmem.time.time", lambda: later)
        token = platform.signed(platform.claims("t-1", asked["nonce"]))
        assert refused(client.post("/lti/launch/", {"id_token": token, "state": asked["state"]})) == "lti_expired"


def test_one_address_launches_so_often_a_minute(platform, monkeypatch):
    monkeypatch.setattr("courses.lti.views.RATE", "2/m")
    cache.clear()
    send(Client(), platform, "t-1")
    assert refused(Client().get("/lti/log-in/")) == "lti_too_many"
    assert refused(Client().post("/lti/launch/")) == "lti_too_many"


class TestPlatforms:
    def test_a_second_platform_cannot_speak_for_the_first(self, platform, registered):
        with running_platform(key=other_key(), people=platform.people) as other:
            LtiPlatform.objects.create(
                name="Other",
                issuer=other.base,
                client_id=registered.client_id,
                deployments=registered.deployments,
                authorize_url=f"{other.base}/authorize",
                token_url=f"{other.base}/token",
                jwks_url=f"{other.base}/jwks",
            )
            client = Client()
            asked = begin(client, other, "t-1")
            for body, signed in (
                (platform.claims("t-1", asked["nonce"]), other.signed),
                (platform.claims("t-1", asked["nonce"]), platform.signed),
            ):
                answer = client.post("/lti/launch/", {"id_token": signed(body), "state": asked["state"]})
                assert refused(answer) in ("lti_platform_unknown", "lti_expired")
                asked = begin(client, other, "t-1")

    def test_the_same_person_of_another_platform_is_somebody_else(self, platform, registered):
        assert LtiAccount.objects.filter(platform=registered, sub="t-1").count() == 1

    def test_an_inactive_platform(self, platform, registered):
        LtiPlatform.objects.update(is_active=False)
        asked = {"iss": platform.base, "login_hint": "t-1", "target_link_uri": f"{SITE}/lti/launch/"}
        assert refused(Client().get("/lti/log-in/", asked)) == "lti_platform_unknown"

    @pytest.mark.parametrize(
        "asked",
        [
            {},
            {"iss": "https://elsewhere.example.org", "login_hint": "x"},
            {"login_hint": "x"},
            {"iss": "PLATFORM"},
            {"iss": "PLATFORM", "login_hint": "x" * 5000},
            {"iss": "PLATFORM", "login_hint": "x", "client_id": "other"},
        ],
        ids=str,
    )
    def test_a_log_in_that_is_incomplete_or_unknown(self, platform, asked):
        sent = {name: value.replace("PLATFORM", platform.base) for name, value in asked.items()}
        assert refused(Client().get("/lti/log-in/", sent)) in ("lti_log_in", "lti_platform_unknown")

    @pytest.mark.parametrize("address", ["http://10.0.0.1/jwks", "http://localhost/jwks", "file:///etc/passwd", "x"])
    def test_private_addresses_are_not_asked(self, platform, settings, address):
        settings.LTI_PRIVATE = False
        LtiPlatform.objects.update(jwks_url=address)
        cache.clear()
        before = platform.fetched
        assert refused(send(Client(), platform, "s-1")) in ("lti_address", "lti_token")
        assert platform.fetched == before


@pytest.mark.parametrize(
    "target", ["https://evil.example.org/", "//evil.example.org", "javascript:alert(1)", "/admin/"]
)
def test_a_launch_ends_on_our_pages_alone(platform, target):
    client = Client()
    asked = begin(client, platform, "t-1", target_link_uri=target)
    assert asked["redirect_uri"] == f"{SITE}/lti/launch/"
    body = platform.claims("t-1", asked["nonce"], **{f"{CLAIM}target_link_uri": target})
    answer = client.post("/lti/launch/", {"id_token": platform.signed(body), "state": asked["state"]})
    assert answer["Location"] == "/lti/arrival/"
    ended: Any = client.get("/lti/arrival/")
    assert urlsplit(ended["Location"]).netloc == ""
    assert ended["Location"].startswith("/classes/")


def test_the_tests_platform_makes_unsigned_tokens(platform):
    """Else the test of “none” would prove nothing."""
    token = platform.signed({"a": 1}, algorithm="none", key=None)
    assert jwt.get_unverified_header(token)["alg"] == "none"
