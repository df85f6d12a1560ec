"""What webhooks are posted to: never home, whatever the name says, and never for longer than ten seconds."""

from __future__ import annotations

import socket
from threading import Event, Thread
from time import monotonic

import pytest

from league.webhooks import outgoing_requests as outgoing
from paddock.errors import UserFault

PRIVATE = (
    *("127.0.0.1", "127.8.8.8", "0.0.0.0", "10.1.2.3", "172.16.0.1", "192.168.1.1", "169.254.169.254", "100.64.0.1"),
    *("224.0.0.1", "255.255.255.255", "::1", "::", "fe80::1%eth0", "fc00::1", "ff02::1", "::ffff:127.0.0.1"),
    *("::ffff:10.0.0.1", "64:ff9b::7f00:1", "2002:7f00:1::", "2001:db8::1"),
    *("fec0::1", "::127.0.0.1", "::ffff:0:7f00:1", "64:ff9b:1::7f00:1", "2001:0:7f00:1::", "192.0.0.1", "240.0.0.1"),
    *("168.63.129.16", "::ffff:168.63.129.16", "64:ff9b::a83f:8110"),
)


class TestAddresses:
    @pytest.mark.parametrize("address", PRIVATE)
    def test_a_private_address_is_not_public(self, address):
        assert not outgoing.is_public(address)

    @pytest.mark.parametrize("address", ["8.8.8.8", "2606:4700:4700::1111"])
    def test_a_public_address_is_public(self, address):
        assert outgoing.is_public(address)

    @pytest.mark.parametrize(
        "host",
        [
            *(
                "127.1",
                "2130706433",
                "0x7f000001",
                "0x7f.1",
                "017700000001",
                "0177.0.0.1",
                "0",
                "localhost",
                "LOCALHOST",
            ),
            *("[::1]", "[::]", "[::ffff:7f00:1]", "[::ffff:127.0.0.1]", "[0:0:0:0:0:ffff:7f00:1]", "[64:ff9b::7f00:1]"),
        ],
    )
    def test_a_disguised_loopback_address_is_refused_unconnected(self, listener, host):
        """The resolver itself reads these spellings."""
        with pytest.raises((UserFault, OSError)) as refused:
            outgoing.post(f"http://{host}:{listener.server.server_port}/", b"", {})
        assert not listener.heard
        assert not isinstance(refused.value, UserFault) or refused.value.code in ("webhook_private", "webhook_name")

    @pytest.mark.parametrize(
        "url",
        [
            "http://127.0.0.1\\@example.org/",
            "http://１２７.0.0.1/",
            "http://127。0。0。1/",
            "http://x/\r\nA: b",
            "http:///x",
        ],
    )
    def test_an_address_that_two_readers_read_differently_is_refused(self, url):
        with pytest.raises(UserFault) as refused:
            outgoing.post(url, b"", {})
        assert refused.value.code == "webhook_address"

    @pytest.mark.parametrize(
        "url",
        ["ftp://example.org/", "http://", "http://user:word@example.org/", "file:///etc/passwd", "http://x:99999/"],
    )
    def test_an_invalid_url_is_refused(self, url):
        with pytest.raises(UserFault) as refused:
            outgoing.checked(url)
        assert refused.value.code == "webhook_address"

    def test_a_name_of_a_private_address_is_refused_unconnected(self, listener, monkeypatch):
        def resolve(host: str, port: int, **kwargs: object) -> list:
            return [(0, 0, 0, "", (address, port)) for address in ("8.8.8.8", "127.0.0.1")]

        monkeypatch.setattr(socket, "getaddrinfo", resolve)
        with pytest.raises(UserFault) as refused:
            outgoing.post(f"http://innocent.example:{listener.server.server_port}/", b"", {})
        assert refused.value.code == "webhook_private" and not listener.heard

    def test_the_connection_uses_the_address_that_was_checked(self, monkeypatch):
        asked, connected = [], []

        def resolve(host: str, port: int | None, **kwargs: object) -> list:
            asked.append(host)
            # a name that changes its mind leads home the second time
            known = {"hook.example": "8.8.8.8" if asked.count(host) == 1 else "127.0.0.1"}
            return [(0, 0, 0, "", (known.get(host, "127.0.0.1"), port))]

        def connect(address: tuple, timeout: float) -> None:
            connected.append(address)
            raise OSError("stop here")

        monkeypatch.setattr(socket, "getaddrinfo", resolve)
        monkeypatch.setattr(socket, "create_connection", connect)
        with pytest.raises(OSError, match="stop here"):
            outgoing.post("https://hook.example/path", b"", {})
        assert asked.count("hook.example") == 1 and connected == [("8.8.8.8", 443)]

    @pytest.mark.parametrize(
        ("host", "address"),
        [
            ("paddock.example.org", "8.8.4.4"),
            ("PADDOCK.example.org.", "8.8.4.4"),
            ("innocent.example", "8.8.8.8"),
            ("behind.example", "64:ff9b::808:808"),
            ("the-machine.example", "9.9.9.9"),
        ],
        ids=["its name", "its name, spelled otherwise", "its address", "its address in disguise", "an interface's"],
    )
    def test_the_sites_own_public_address_is_refused(self, host, address, settings, monkeypatch):
        """It is 8.8.8.8 by its name; the machine behind it has 9.9.9.9."""
        settings.SITE_URL, settings.ALLOWED_HOSTS = "https://paddock.example.org", [".paddock.example.org", "*"]
        known = {"paddock.example.org": "8.8.8.8", host: address}
        monkeypatch.setattr(*(socket, "getaddrinfo"), lambda name, port, **kwargs: [(0, 0, 0, "", (known[name], port))])
        monkeypatch.setattr(outgoing, "is_of_this_machine", lambda given: given == "9.9.9.9")
        with pytest.raises(UserFault) as refused:
            outgoing.public_addresses(host)
        assert refused.value.code == "webhook_private"
        assert outgoing.public_addresses(host, allow_private=True) == [address]

    def test_another_public_address_is_allowed(self, settings, monkeypatch):
        settings.SITE_URL, settings.ALLOWED_HOSTS = "https://paddock.example.org", ["gone.example"]

        def resolve(name: str, port: int | None, **kwargs: object) -> list:
            if name == "gone.example":
                raise socket.gaierror(socket.EAI_NONAME, "no such name")
            return [(0, 0, 0, "", ("8.8.8.8" if name == "paddock.example.org" else "8.8.4.4", port))]

        monkeypatch.setattr(socket, "getaddrinfo", resolve)
        assert outgoing.public_addresses("elsewhere.example") == ["8.8.4.4"]

    @pytest.mark.parametrize(("address", "ours"), [("127.0.0.1", True), ("::ffff:127.0.0.1", True), ("8.8.8.8", False)])
    def test_the_kernel_lists_the_addresses_of_this_machine(self, address, ours):
        assert outgoing.is_of_this_machine(address) is ours


class TestTime:
    """The whole of a delivery is bounded, wherever the other side drips."""

    @pytest.fixture
    def dripping(self, monkeypatch):
        """A server that says nothing but a byte each 50 ms, as a record of TLS or as a header; its port by scheme."""
        monkeypatch.setattr(outgoing, "WHOLE_S", 0.4)
        stop = Event()
        listening = socket.create_server(("127.0.0.1", 0))

        def drip() -> None:
            met, _ = listening.accept()
            with met:
                first = met.recv(1, socket.MSG_PEEK)
                said = b"HTTP/1.1 200" if first == b"P" else b"\x16\x03\x03\x40\x00\x02"
                for byte in said + b"a" * 1000:
                    if stop.wait(0.05):
                        return
                    try:
                        met.sendall(bytes([byte]))
                    except OSError:
                        return

        thread = Thread(target=drip)
        thread.start()
        yield listening.getsockname()[1]
        stop.set()
        listening.close()
        thread.join()

    @pytest.mark.parametrize("scheme", ["http", "https"])
    def test_a_slow_dripping_server_is_cut_off(self, dripping, scheme):
        began = monotonic()
        with pytest.raises(TimeoutError):
            outgoing.post(f"{scheme}://127.0.0.1:{dripping}/", b"{}", {}, allow_private=True)
        assert monotonic() - began < 10

    def test_an_unresponsive_resolver_is_not_awaited(self, monkeypatch):
        monkeypatch.setattr(outgoing, "LOOKUP_S", 0.1)
        stop = Event()
        monkeypatch.setattr(socket, "getaddrinfo", lambda *args, **kwargs: stop.wait(30) and [])
        began = monotonic()
        with pytest.raises(TimeoutError):
            outgoing.post("http://drips.example/", b"{}", {}, allow_private=True)
        stop.set()
        assert monotonic() - began < 10

    @pytest.mark.parametrize("host", ["a..b", "x" * 64 + ".example"])
    def test_an_invalid_host_name_is_reported_as_unknown(self, host):
        with pytest.raises(socket.gaierror):
            outgoing.addresses_of(host)
