"""The stream process, really started: who is told what, what comes back after an end, and what is cut."""

from __future__ import annotations

import re
import signal
import socket

import pytest
from django.contrib.auth import get_user_model
from django.contrib.sessions.models import Session

from core.events.models import Event
from core.streams import poke, push
from core.wakeups import streams as ringing
from evaluation.running.queue.services import stop_evaluation
from races.entries.services.entries import accept_invitation, remove_entry
from races.entries.services.submissions import submit_model
from races.events import record_board
from races.models import Visibility
from races.pages.services import renew_spectator_link
from races.web.spectator_links import spectator_token
from tests.evaluation.processes import wait_for
from tests.factories import a_model, a_race, a_racer
from tests.streams.conftest import PER_ADDRESS, PER_RACER
from tests.streams.process import Listener, served

pytestmark = [pytest.mark.django_db(transaction=True), pytest.mark.slow, pytest.mark.xdist_group("streams")]
SILENCE_S = 1.5


@pytest.fixture
def cast(streams, now):
    """Owner, member, stranger, staff and a guest, and a race by invitation."""
    owner, member = a_racer("owner"), a_racer("member")
    race = a_race(now, organiser=owner, visibility=Visibility.INVITATION)
    accept_invitation(token=race.invitation, racer=member, now=now)
    people = {"owner": owner, "member": member, "stranger": a_racer("stranger"), "guest": None}
    return race, people | {"staff": a_racer("staff", is_staff=True)}


def test_a_private_race_moves_for_those_who_may_see_it_alone(streams, cast):
    race, people = cast
    topic = f"race:{race.pk}"
    listening = {name: Listener(streams.port, topic, racer=who).hello() for name, who in people.items()}
    record_board(race)
    for name in ("owner", "member", "staff"):
        told = listening[name].next()
        assert told is not None and told.data["of"] == [topic], name
        assert told.id == str(Event.objects.latest("position").position)
    for name in ("stranger", "guest"):
        assert listening[name].next(SILENCE_S) is None, name
        assert not listening[name].is_over, "and nothing tells that there is one"
    for each in listening.values():
        with each:
            pass


def test_what_is_not_there_and_what_may_not_be_seen_answer_alike(streams, cast):
    race, _ = cast
    with Listener(streams.port, f"race:{race.pk}") as hidden, Listener(streams.port, "race:99999") as none:
        assert hidden.status == none.status == 200 and without_id(hidden.head) == without_id(none.head)
        assert (hidden.next().event, none.next().event) == ("hello", "hello")
    with Listener(streams.port, "race:<script>") as nonsense:
        assert nonsense.status == 400


def without_id(head: str) -> str:
    """What comes before and after the id of the request."""
    return re.sub(r"x-request-id: \w+", "", head)


def test_who_was_removed_hears_nothing_more(streams, cast, now):
    race, people = cast
    with Listener(streams.port, f"race:{race.pk}", racer=people["member"]).hello() as member:
        record_board(race)
        assert member.next() is not None
        entry = race.entries.get(racer=people["member"])
        remove_entry(entry=entry, by=people["owner"], now=now)
        assert member.next() is not None, "the page asks once more, and is refused"
        record_board(race)
        assert member.next(SILENCE_S) is None


def test_an_admin_who_is_one_no_more_hears_nothing_more(streams, cast):
    race, people = cast
    with Listener(streams.port, f"race:{race.pk}", racer=people["staff"]).hello() as staff:
        get_user_model().objects.filter(pk=people["staff"].pk).update(is_staff=False)
        record_board(race)
        assert staff.next() is not None, "the page asks once more, and is refused"
        record_board(race)
        assert staff.next(SILENCE_S) is None


def test_a_spectator_follows_until_the_link_is_renewed(streams, cast, now):
    race, people = cast
    topics, token = (f"live:{race.pk}", f"race:{race.pk}"), spectator_token(race)
    with (
        Listener(streams.port, *topics, spectator=token).hello() as guest,
        Listener(streams.port, *topics, spectator=token, racer=people["stranger"]).hello() as stranger,
        Listener(streams.port, *topics, spectator=token, racer=people["member"]).hello() as member,
    ):
        record_board(race)
        for each in (guest, stranger, member):
            told = each.next()
            assert told is not None and sorted(told.data["of"]) == sorted(topics)
        renew_spectator_link(race=race, now=now)
        told = guest.next()
        assert told is not None and told.event == "gone"
        assert guest.next() is None and guest.is_over
        assert stranger.next() is not None, "the page asks once more, and is refused"
        assert member.next() is not None
        record_board(race)
        assert stranger.next(SILENCE_S) is None
        assert member.next() is not None
    with Listener(streams.port, *topics, spectator=token).hello() as late:
        record_board(race)
        assert late.next(SILENCE_S) is None


def test_a_log_out_ends_the_stream(streams, cast):
    race, people = cast
    with Listener(streams.port, f"race:{race.pk}", racer=people["owner"]).hello() as owner:
        Session.objects.filter(session_key=owner.session).delete()
        record_board(race)
        told = owner.next()
        assert told is not None and told.event == "gone"
        assert owner.next() is None and owner.is_over


def test_me_is_the_reader_and_nobody_else(streams, now):
    ann, bob = a_racer("ann"), a_racer("bob")
    with (
        Listener(streams.port, "me", racer=ann).hello() as mine,
        Listener(streams.port, f"racer:{ann.pk}", racer=bob).hello() as theirs,
        Listener(streams.port, "me").hello() as nobodys,
    ):
        run = submit_model(race=a_race(now), racer=ann, model=a_model(ann), now=now).evaluation
        assert mine.next().data["of"] == [f"racer:{ann.pk}"]
        stop_evaluation(evaluation=run, now=now)
        assert mine.next() is not None
        assert theirs.next(SILENCE_S) is None and nobodys.next(0.2) is None


def test_a_run_moves_its_race_for_guests_too(streams, now):
    race, ann = a_race(now), a_racer("ann")
    with Listener(streams.port, f"race:{race.pk}", "races", "run:nobody").hello() as guest:
        submit_model(race=race, racer=ann, model=a_model(ann), now=now)
        assert guest.next().data["of"] == [f"race:{race.pk}", "races"]


def test_who_comes_back_is_told_what_was_missed_once_the_process_lives_again(streams, now):
    race = a_race(now)
    topic = f"race:{race.pk}"
    with Listener(streams.port, topic).hello() as first:
        record_board(race)
        seen = first.next().id
        streams.end(signal.SIGKILL)
        assert first.next() is None and first.is_over
    record_board(race)
    record_board(race)
    streams.start()
    wait_for(streams.is_up_to_date, 20, streams.log)
    missed = [int(seen) + 1, int(seen) + 2]
    for again in (Listener(streams.port, topic, header=seen), Listener(streams.port, topic, last=seen)):
        with again:
            assert again.next().data == {"of": [topic], "at": missed}
            hello = again.next()
            assert (hello.event, hello.id) == ("hello", str(missed[-1]))
    with Listener(streams.port, topic, header=str(missed[-1])) as knows:
        assert knows.next().event == "hello"


def test_who_was_away_too_long_reads_the_page_anew(streams, now):
    race = a_race(now)
    for _ in range(3):
        record_board(race)
    wait_for(streams.is_up_to_date, 20, streams.log)
    Event.objects.order_by("position")[0].delete()
    for known in ("0", "123456789"):  # not kept any more; of another table
        with Listener(streams.port, f"race:{race.pk}", header=known) as back:
            assert back.next().event == "reload"


def test_without_the_bell_events_come_a_second_later(streams, now, settings):
    race = a_race(now)
    settings.STREAM_BELL_URL = ""
    with Listener(streams.port, f"race:{race.pk}").hello() as guest:
        record_board(race)
        assert guest.next() is not None


def test_a_broken_bell_is_heard_again(streams, now, settings):
    """Its connections are ended, as they are when the server dies."""
    race = a_race(now)
    topic = f"race:{race.pk}"
    with Listener(streams.port, topic).hello() as guest:
        poke([topic])
        assert guest.next().data == {"of": [topic]}
        ringing._server.client_kill_filter(_type="pubsub")
        record_board(race)
        assert guest.next() is not None, "it looks by itself"

        def heard() -> bool:
            poke([topic])
            return guest.next(0.5) is not None

        wait_for(heard, 20, streams.log)


def test_a_reader_who_takes_nothing_is_cut(streams, now):
    race = a_race(now)
    topic = f"race:{race.pk}"
    slow = Listener(streams.port, topic).hello()
    slow._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    with slow, Listener(streams.port, topic).hello() as quick:
        for _ in range(1200):
            assert push(topic, {"long": "x" * 8000})
            assert quick.next() is not None, "the others are told as ever"
            if streams.figures()["streams"] == 1:
                break
        assert streams.figures()["streams"] == 1


def test_there_are_only_so_many_streams(streams):
    ann = a_racer("ann")
    listening = [Listener(streams.port, "me", racer=ann).hello() for _ in range(PER_RACER)]
    refused = Listener(streams.port, "me", racer=ann)
    assert refused.status == 429 and "retry-after" in refused.head
    listening += [Listener(streams.port, "races").hello() for _ in range(PER_ADDRESS - PER_RACER)]
    assert Listener(streams.port, "races").status == 429
    listening.pop()._socket.close()
    wait_for(lambda: streams.figures()["streams"] < PER_ADDRESS, 10, streams.log)
    with Listener(streams.port, "races") as again:
        assert again.status == 200
    for each in listening:
        each._socket.close()
    wait_for(lambda: streams.figures()["streams"] == 0, 10, streams.log)


def test_the_web_server_hands_streams_over_and_answers_while_nobody_takes_them(streams, now):
    race = a_race(now)
    topic = f"race:{race.pk}"
    with served(streams) as port:
        with Listener(port, topic).hello() as guest:
            record_board(race)
            assert guest.next().data["of"] == [topic]
            assert streams.figures()["streams"] == 1
            assert streams.end() == 0, "SIGTERM ends it in good order"
            assert guest.next() is None and guest.is_over
        with Listener(port, topic) as away:
            assert away.status == 200 and away.next().event == "away"
        streams.start()
        with Listener(port, topic).hello() as back:
            poke([topic])
            assert back.next() is not None
        # on a connection that served a page before, in pieces
        with socket.create_connection(("127.0.0.1", port), timeout=15) as connection:
            connection.sendall(b"GET /health/live HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            before = b""
            while not before.endswith(b"ok\n"):
                before += connection.recv(65536)
            connection.sendall(b"GET /stream/?of=races HTTP/1.1\r\n")
            connection.sendall(b"Host: 127.0.0.1\r\n\r\n")
            got = b""
            while b"event: hello" not in got:
                got += connection.recv(65536)


@pytest.mark.postgres
@pytest.mark.soak
@pytest.mark.django_db(transaction=False)
def test_the_same_holds_on_postgresql(again_on_postgresql):
    again_on_postgresql("tests/streams/test_streams.py")
