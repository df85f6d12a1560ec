"""The stream as programs use it: a token of the API, an HTTP client, and no browser."""

from __future__ import annotations

import json
from collections.abc import Iterator
from http.client import HTTPConnection, HTTPResponse
from urllib.parse import urlencode

import pytest
from django.utils import timezone
from knox.models import AuthToken

from accounts.models import Racer
from accounts.tokens.services import create_token
from core.events.models import Event
from core.streams.reading import REPLAYED, newest
from races.entries.services.entries import accept_invitation, remove_entry
from races.events import record_board
from races.models import Race, Visibility
from tests.evaluation.processes import wait_for
from tests.factories import a_race, a_racer
from tests.streams.process import Streams, served

pytestmark = [pytest.mark.django_db(transaction=True), pytest.mark.slow, pytest.mark.xdist_group("streams")]


class Program:
    """An open request of the stream, as ``http.client`` makes it."""

    def __init__(self, port: int, *topics: str, **headers: str) -> None:
        self._connection = HTTPConnection("127.0.0.1", port, timeout=15)
        sent = {name.replace("_", "-"): value for name, value in headers.items()}
        self._connection.request("GET", f"/stream/?{urlencode([('of', each) for each in topics])}", headers=sent)
        self.answer: HTTPResponse = self._connection.getresponse()
        self.status = self.answer.status

    def __enter__(self) -> Program:
        return self

    def __exit__(self, *exc: object) -> None:
        self.answer.close()
        self._connection.close()

    def refusal(self) -> tuple[int, str]:
        told = json.loads(self.answer.read())
        assert told["message"] and told["fault"] == "user"
        return self.status, told["code"]

    def messages(self) -> Iterator[dict]:
        """Messages with their fields; ``data`` is read, signs of life are left out."""
        fields: dict = {}
        while line := self.answer.readline():
            name, _, value = line.decode().rstrip("\n").partition(": ")
            if name:
                fields[name] = json.loads(value) if name == "data" else value
            elif fields:
                if fields.get("event") != "beat":
                    yield fields
                fields = {}


@pytest.fixture
def owner(streams) -> Racer:
    return a_racer("owner")


@pytest.fixture
def race(streams, owner, now) -> Race:
    return a_race(now, organiser=owner, visibility=Visibility.INVITATION)


def bearer(racer: Racer, **fields: object) -> str:
    return f"Bearer {create_token(racer=racer, now=timezone.now(), **fields)[1]}"


def test_a_program_follows_what_its_racer_may_see(streams: Streams, race, owner):
    topic = f"race:{race.pk}"
    with Program(streams.port, topic, Authorization=bearer(owner)) as program:
        assert (program.status, program.answer.headers.get_content_type()) == (200, "text/event-stream")
        messages = program.messages()
        hello = next(messages)
        assert (hello["event"], hello["retry"]) == ("hello", "2000") and int(hello["id"]) >= 0
        record_board(race)
        told = next(messages)
        assert told["data"] == {"of": [topic], "at": [Event.objects.latest("position").position]}
        assert told["id"] == str(told["data"]["at"][0]) and "event" not in told


def test_me_is_the_racer_of_the_token(streams, race, owner):
    with Program(streams.port, "me", Authorization=bearer(owner).replace("Bearer", "Token")) as program:
        messages = program.messages()
        next(messages)
        Event.objects.create(kind="test.happened", at=timezone.now(), racer=owner)
        record_board(race)
        assert next(messages)["data"]["of"] == [f"racer:{owner.pk}"]


def test_who_reconnects_with_the_last_id_misses_nothing(streams, race, owner):
    topic, token = f"race:{race.pk}", bearer(owner)
    with Program(streams.port, topic, Authorization=token) as program:
        last = next(program.messages())["id"]
    for _ in range(3):
        record_board(race)
    wait_for(streams.is_up_to_date, 20, streams.log)
    with Program(streams.port, topic, Authorization=token, Last_Event_ID=last) as program:
        messages = program.messages()
        told, hello = next(messages), next(messages)
        assert told["data"]["of"] == [topic] and len(told["data"]["at"]) == 3
        assert (hello["event"], hello["id"]) == ("hello", str(told["data"]["at"][-1]))


@pytest.mark.parametrize("last", ["too old", "999999999", "-1", "nonsense", "9" * 30])
def test_an_id_that_is_too_old_or_unknown_gets_the_event_reload(streams, race, owner, last):
    if last == "too old":
        record_board(race)
        last = str(newest())
        Event.objects.bulk_create([Event(kind="x", at=timezone.now()) for _ in range(REPLAYED + 1)])
        wait_for(streams.is_up_to_date, 20, streams.log)
    with Program(streams.port, f"race:{race.pk}", Authorization=bearer(owner), Last_Event_ID=last) as program:
        messages = program.messages()
        assert next(messages)["event"] == "reload"
        assert next(messages)["event"] == "hello"


@pytest.mark.parametrize("topic", ["weather:7", "nonsense", "race:<script>", "RACE:7", ""])
def test_an_unknown_topic_is_refused_with_a_reason(streams, owner, topic):
    for headers in ({}, {"Authorization": bearer(owner)}):
        if not topic and not headers:
            continue  # a page that shows nothing that moves
        with Program(streams.port, *([topic] if topic else []), **headers) as program:
            assert program.refusal() == (400, "stream_topics")


def test_a_forbidden_and_a_missing_topic_are_refused_alike(streams, race, owner):
    token = bearer(a_racer("stranger"))
    for topic in (f"race:{race.pk}", f"live:{race.pk}", "race:99999", "run:nothing", f"racer:{owner.pk}", "queue:7"):
        with Program(streams.port, topic, "races", Authorization=token) as program:
            assert program.refusal() == (404, "stream_topic_hidden"), topic


def test_an_invalid_token_is_refused(streams, owner):
    expired = bearer(owner)
    AuthToken.objects.update(expiry=timezone.now())
    training = bearer(owner, scopes=["train"])
    for header in (expired, training, "Bearer nonsense", "Bearer", "Basic b3duZXI6cGFzcw==", "Bearer ümläut"):
        with Program(streams.port, "races", Authorization=header.encode().decode("latin-1")) as program:
            assert program.answer.headers["WWW-Authenticate"] == "Bearer"
            assert program.refusal() == (401, "stream_token"), header


def test_a_revoked_token_ends_the_stream(streams, race, owner):
    with Program(streams.port, f"race:{race.pk}", Authorization=bearer(owner)) as program:
        messages = program.messages()
        next(messages)
        AuthToken.objects.all().delete()
        record_board(race)
        assert next(messages)["event"] == "gone"
        assert next(messages, None) is None


def test_who_is_removed_hears_nothing_more(streams, race, owner, now):
    member = a_racer("member")
    accept_invitation(token=race.invitation, racer=member, now=now)
    with Program(streams.port, f"race:{race.pk}", "me", Authorization=bearer(member)) as program:
        messages = program.messages()
        next(messages)
        remove_entry(entry=race.entries.get(racer=member), by=owner, now=now)
        assert f"race:{race.pk}" in next(messages)["data"]["of"]
        record_board(race)
        Event.objects.create(kind="test.happened", at=timezone.now(), racer=member)
        record_board(race)
        assert next(messages)["data"]["of"] == [f"racer:{member.pk}"]
    with Program(streams.port, f"race:{race.pk}", Authorization=bearer(member)) as program:
        assert program.refusal() == (404, "stream_topic_hidden")


def test_the_web_server_hands_a_program_over(streams, race, owner):
    with served(streams) as port, Program(port, f"race:{race.pk}", Authorization=bearer(owner)) as program:
        messages = program.messages()
        assert next(messages)["event"] == "hello"
        record_board(race)
        assert next(messages)["data"]["of"] == [f"race:{race.pk}"]


def test_the_api_names_the_topic_of_a_race(streams, race, owner, client):
    client.force_login(owner)
    topic = client.get(f"/api/v1/races/{race.slug}/").json()["topic"]
    with Program(streams.port, topic, Authorization=bearer(owner)) as program:
        assert program.status == 200
