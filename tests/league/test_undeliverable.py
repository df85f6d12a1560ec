"""A webhook's address that no delivery can reach is refused when it is added, with a reason."""

from __future__ import annotations

import socket

import pytest

from league.webhooks import outgoing_requests as outgoing
from league.webhooks.services import add_webhook
from paddock.errors import UserFault
from tests.league.test_outgoing import PRIVATE

ADDRESS = [
    *(
        "ftp://example.org/",
        "example.org/hook",
        "//example.org/",
        "http://",
        "https:///path",
        "http://:80/",
        "mailto:a@b",
    ),
    *("https://user@example.org/", "https://user:word@example.org/", "https://@example.org/", "https://:@example.org/"),
    *("https://example.org/#top", "https://example.org/hook#", "https://example.org:0/", "https://example.org:65536/"),
    *("https://example.org:-1/", "https://example.org:http/", "https://exa mple.org/", "https://example.org/a\nb"),
    *("https://example.org/\t", " https://example.org/", "https://exämple.org/", "https://example.org/ü"),
    *("https://a..b/", "https://-a.org/", f"https://{'x' * 64}.org/", f"https://{'x.' * 130}org/"),
    *("http://127.0.0%2e1/", "http://[fe80::1%25eth0]/", "http://[::1/", "http://256.1.1.1/", "http://1.2.3.4.5/"),
    *("http://0x7f.0.0.0x100/", "http://4294967296/", "http://127.0.0.1./", f"https://example.org/{'a' * 500}"),
]
NAME = [
    *(
        "http://localhost/",
        "http://LOCALHOST:8080/",
        "http://localhost./",
        "https://a.localhost/",
        "https://car.local/",
    ),
    *("https://db.internal/", "https://metadata.google.internal/", "https://x.invalid/", "https://x.test./"),
    *("https://nas.lan/", "https://router.home/", "https://intranet/", "https://x.onion/"),
]
NUMBER = [
    *("http://2130706433/", "http://0x7f000001/", "http://0x7F.1/", "http://0177.0.0.1/", "http://127.1/"),
    *("http://017700000001/", "http://10.1/", "http://0xa9fea9fe/latest", "http://0/", "http://192.168.257/"),
    *("http://[::ffff:127.0.0.1]/", "http://[::ffff:7f00:1]/", "http://[0:0:0:0:0:ffff:a00:1]/", "http://[::]:8000/"),
    *("https://[64:ff9b::7f00:1]/", "http://100.64.0.1/", "http://169.254.169.254/"),
    *(f"http://[{one}]/" if ":" in one else f"http://{one}/" for one in PRIVATE if "%" not in one),
]


@pytest.fixture
def names(settings, monkeypatch) -> dict[str, str]:
    """What names lead to; others lead nowhere. Numbers are read as the system reads them."""
    settings.WEBHOOKS_PRIVATE = False
    known: dict[str, str] = {}
    system = socket.getaddrinfo

    def resolve(host: str, port: int | None, **options: object) -> list:
        if host in known:
            return [(0, 0, 0, "", (known[host], port))]
        return system(host, port, flags=socket.AI_NUMERICHOST, **options)

    monkeypatch.setattr(socket, "getaddrinfo", resolve)
    return known


@pytest.mark.parametrize(
    ("code", "urls"), [("webhook_address", ADDRESS), ("webhook_name", NAME), ("webhook_private", NUMBER)]
)
def test_it_is_refused_with_a_reason(code, urls, alice, names):
    found = {}
    for url in urls:
        with pytest.raises(UserFault) as refused:
            add_webhook(owner=alice, url=url)
        found[url] = refused.value.code
    assert {url: one for url, one in found.items() if one != code} == {}
    assert not alice.webhooks.exists()


def test_a_name_of_a_private_address_is_refused(alice, names):
    names["innocent.example.org"] = "10.0.0.1"
    with pytest.raises(UserFault) as refused:
        add_webhook(owner=alice, url="https://innocent.example.org/")
    assert refused.value.code == "webhook_private"


@pytest.mark.parametrize(
    "url", ["https://not-yet.example.org/", "https://8.8.8.8:8443/a?b=c", "http://[2606:4700::1]/"]
)
def test_a_public_address_and_a_name_that_has_none_yet_are_accepted(url, alice, names):
    assert add_webhook(owner=alice, url=url).url == url


@pytest.mark.parametrize("url", ["http://127.0.0.1:8000/", "http://box.local/", "http://intranet/hook"])
def test_a_site_for_private_networks_accepts_them(url, alice, names, settings):
    settings.WEBHOOKS_PRIVATE = True
    assert add_webhook(owner=alice, url=url).url == url
    with pytest.raises(UserFault) as refused:
        add_webhook(owner=alice, url="https://user@example.org/")
    assert refused.value.code == "webhook_address"


def test_a_delivery_refuses_the_same_names(names):
    with pytest.raises(UserFault) as refused:
        outgoing.post("http://box.local/", b"{}", {})
    assert refused.value.code == "webhook_name"


def test_the_api_and_the_page_say_why(client, alice, names):
    client.force_login(alice)
    told = client.post("/settings/webhooks/", {"url": "http://127.0.0.1/", "events": ["run.finished"]})
    assert told.status_code == 422 and "private network" in told.content.decode()
    answer = client.post("/api/v1/webhooks/", {"url": "http://127.0.0.1/"}, content_type="application/json")
    assert (answer.status_code, answer.json()["code"]) == (400, "webhook_private")
    assert not alice.webhooks.exists()
