"""Following racers by a program."""

from __future__ import annotations

import pytest

from accounts.models import Follow
from tests.factories import a_racer

pytestmark = pytest.mark.django_db
AT = "/api/v1/following/"


def test_racers_are_followed_listed_and_followed_no_more(client):
    racer, other = a_racer(), a_racer("quick")
    assert client.get(AT).status_code == 401
    assert client.put(f"{AT}quick/").status_code == 401
    client.force_login(racer)
    for _ in range(2):
        put = client.put(f"{AT}QUICK/")
        assert (put.status_code, put.json()["racer"]) == (200, "quick")
    assert [one["racer"] for one in client.get(AT).json()["results"]] == ["quick"]
    client.force_login(other)
    assert client.get(AT).json()["results"] == []
    client.force_login(racer)
    for _ in range(2):
        assert client.delete(f"{AT}quick/").status_code == 204
    assert not Follow.objects.exists()


@pytest.mark.parametrize(
    ("alias", "body", "status"), [("nobody", None, 404), ("me", None, 403), ("quick", {"more": 1}, 400)]
)
def test_what_cannot_be_followed_changes_nothing(client, alias, body, status):
    a_racer("quick")
    client.force_login(a_racer("me"))
    sent = client.put(f"{AT}{alias}/", body or {}, content_type="application/json")
    assert sent.status_code == status
    assert not Follow.objects.exists()
