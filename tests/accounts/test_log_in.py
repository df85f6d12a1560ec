"""Guessing passwords: what it costs, what stops it, and that it never stops the owner."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.contrib.auth import authenticate
from django.contrib.auth.hashers import MD5PasswordHasher
from django.core.cache import cache
from django.test import Client, RequestFactory
from django.utils import timezone

from accounts.models import KnownAddress
from accounts.signing_in.attempt_limits import KNOWN_FOR, KNOWN_PER_RACER, begin
from tests.factories import a_racer

PASSWORD = "correct horse battery"
HOME, SCHOOL, ELSEWHERE = "192.0.2.1", "192.0.2.2", "198.51.100.7"
pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def counted_from_nothing() -> None:
    cache.clear()


def logs_in(login: str, password: str = PASSWORD, at: str = HOME, by: str = "page") -> bool:
    """Whether it opens the account."""
    client = Client(REMOTE_ADDR=at)
    said = {"login": login, "password": password}
    if by == "api":
        return client.post("/api/v1/auth/token/", said, "application/json").status_code == 201
    return client.post("/accounts/login/", said).status_code == 302


def guess(login: str, times: int, at: str = ELSEWHERE, by: str = "page") -> None:
    for number in range(times):
        assert not logs_in(login, f"guess {number}", at, by)


def tried_at_many(number: int, at: str = ELSEWHERE) -> int:
    """Guess at so many racers from one address; how many of the guesses got as far as the password."""
    request = RequestFactory().post("/accounts/login/", REMOTE_ADDR=at)
    now = timezone.now()
    return sum(begin(request, {"username": f"racer-{one}"}, now) is not None for one in range(number))


def crowd(number: int) -> str:
    return f"203.0.113.{number}"


@pytest.fixture
def hashed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Every password that is hashed."""
    found: list[str] = []
    encode = MD5PasswordHasher.encode

    def counting(self: MD5PasswordHasher, password: str, salt: str) -> str:
        found.append(password)
        return encode(self, password, salt)

    monkeypatch.setattr(MD5PasswordHasher, "encode", counting)
    return found


@pytest.mark.parametrize("login", ["alice", "ALICE", "alice@example.org", "nobody", "nobody@example.org"])
@pytest.mark.parametrize("by", ["page", "api"])
def test_a_wrong_password_is_hashed_once(alice, hashed, login, by):
    logs_in(login, "a guess", by=by)
    assert hashed == ["a guess"]


@pytest.mark.parametrize("login", ["alice", "alice@example.org"])
def test_the_right_password_is_hashed_once(alice, hashed, login):
    assert logs_in(login)
    assert hashed == [PASSWORD]


def test_a_session_of_the_old_backend_remains_valid(alice):
    client = Client()
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    assert client.get("/settings/").status_code == 200


def test_a_pending_address_change_does_not_affect_its_owner(alice, bob):
    bob.emailaddress_set.create(email=alice.email, verified=False)
    assert authenticate(email=alice.email, password=PASSWORD) == alice


def test_the_admin_site_has_no_login_of_its_own(alice, hashed):
    answer = Client().get("/admin/login/?next=/admin/")
    assert (answer.status_code, answer["Location"]) == (302, "/accounts/login/?next=%2Fadmin%2F")
    statuses = {
        Client().post("/admin/login/", {"username": "alice", "password": "guess"}).status_code for _ in range(9)
    }
    assert (statuses, hashed) == ({302}, [])


def test_an_admin_reaches_the_admin_site_through_the_site_login(alice):
    alice.is_staff = alice.is_superuser = True
    alice.save()
    client = Client()
    sent = {"login": "alice", "password": PASSWORD, "next": "/admin/"}
    assert client.post("/accounts/login/", sent)["Location"] == "/admin/"
    assert client.get("/admin/").status_code == 200
    assert client.get("/admin/password_change/")["Location"] == "/accounts/password/change/"


def test_the_admin_site_refuses_a_racer(alice):
    client = Client()
    client.force_login(alice)
    assert client.get("/admin/login/").status_code == 403


@pytest.mark.parametrize("by", ["page", "api"])
def test_after_five_guesses_even_the_right_password_fails(alice, hashed, by):
    guess("alice", 5, by=by)
    assert not logs_in("alice", at=ELSEWHERE, by=by)
    assert PASSWORD not in hashed


def test_page_and_api_count_together_in_any_case_of_the_alias(alice):
    guess("alice", 3, by="page")
    guess("Alice", 2, by="api")
    assert not logs_in("alice", at=ELSEWHERE)


@pytest.mark.parametrize("address", ["alice@example.org", "ALICE@example.org", "nobody@example.org"])
def test_locking_an_email_does_not_reveal_its_alias(alice, hashed, address):
    guess(address, 6)
    hashed.clear()
    guess("alice", 1)
    assert hashed == ["guess 0"]


def test_guesses_from_elsewhere_do_not_lock_the_owner_out(alice):
    guess("alice", 9)
    assert logs_in("alice", at=HOME)


def test_forty_racers_behind_one_address_can_log_in_at_once(db):
    pupils = [a_racer(f"pupil-{number}") for number in range(40)]
    for pupil in pupils:
        pupil.set_password(PASSWORD)
        pupil.save()
    assert [logs_in(pupil.alias, at=SCHOOL) for pupil in pupils] == [True] * 40


def test_one_address_can_guess_at_no_more_than_sixty_racers(alice):
    assert tried_at_many(70) == 60
    assert not logs_in("alice", at=ELSEWHERE)
    assert logs_in("alice", at=HOME)


def test_successful_log_ins_do_not_reset_the_count(alice, bob):
    tried_at_many(30)
    assert logs_in("bob", at=ELSEWHERE)
    tried_at_many(60)
    assert logs_in("bob", at=ELSEWHERE)  # known there by now
    assert not logs_in("alice", at=ELSEWHERE)


def test_a_botnet_does_not_lock_out_a_known_address(alice, hashed):
    assert logs_in("alice", at=HOME)
    hashed.clear()
    for number in range(40):
        logs_in("alice", "guess", crowd(number))
    assert len(hashed) == 20
    assert not logs_in("alice", at=crowd(99))
    assert logs_in("alice", at=HOME)


def test_a_known_address_works_though_others_there_are_locked(alice):
    assert logs_in("alice", at=SCHOOL)
    tried_at_many(61, SCHOOL)
    assert logs_in("alice", at=SCHOOL)


def test_a_known_address_gets_five_guesses_a_racer_too(alice, hashed):
    assert logs_in("alice", at=SCHOOL)
    hashed.clear()
    guess("alice", 9, SCHOOL)
    assert len(hashed) == 5


def test_the_last_twenty_addresses_are_known_for_ninety_days(alice):
    for number in range(KNOWN_PER_RACER + 3):
        assert logs_in("alice", at=crowd(number))
    assert alice.known_addresses.count() == KNOWN_PER_RACER
    KnownAddress.objects.update(seen_at=timezone.now() - KNOWN_FOR - timedelta(minutes=1))
    for number in range(100, 120):
        logs_in("alice", "guess", crowd(number))
    assert not logs_in("alice", at=crowd(KNOWN_PER_RACER))


def test_no_address_is_stored_in_plain_text(alice, bob):
    logs_in("alice")
    logs_in("bob")
    digests = set(KnownAddress.objects.values_list("digest", flat=True))
    assert len(digests) == 2
    assert not [digest for digest in digests if HOME in digest]


def test_changing_the_password_allows_five_guesses(alice, hashed):
    client = Client()
    client.force_login(alice)
    sent = {"oldpassword": "guess", "password1": "quite another one", "password2": "quite another one"}
    statuses = [client.post("/accounts/password/change/", sent).status_code for _ in range(7)]
    assert statuses == [200] * 5 + [429] * 2
    assert hashed == ["guess"] * 5
