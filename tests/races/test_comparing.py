"""Two laps against each other: what the gap says, who may ask, and what is refused."""

from __future__ import annotations

import json
from collections.abc import Callable

import pytest
from django.contrib.auth.models import AnonymousUser
from django.db import connection
from django.test import Client
from django.test.utils import CaptureQueriesContext
from django.urls import reverse
from django.utils import timezone

from accounts.models import Follow
from evaluation.models import Evaluation, Result
from paddock.analysis.telemetry import DrivenTrace
from paddock.errors import UserFault
from races.entries.selectors.visibility import can_see_evaluation
from races.entries.services.entries import accept_invitation
from races.entries.services.submissions import submit_model
from races.models import Visibility
from races.replays.comparison import best_lap, compare, lap_line
from races.replays.selectors import Why, comparable_with, offers_to_compare, race_of, refuse_incomparable
from tests.drawn_runs import a_driven_run
from tests.evaluation.stubs import HEADER
from tests.factories import a_model, a_race, a_racer, lap
from tests.kept import Kept

pytestmark = pytest.mark.django_db


@pytest.fixture
def now():
    return timezone.now()


def trace(*steps: tuple[int, float, float, float]) -> DrivenTrace:
    """Of (episode, percent, seconds, m/s)."""
    rows = [f"{e},1,0,0,0,0,{v},1,0,False,True,{p},1,18,{t},in_progress,0,0,{t}" for e, p, t, v in steps]
    return DrivenTrace.of("\n".join([HEADER, *rows, ""]).encode())


def test_the_gap_is_how_much_later_the_other_was_there():
    even = lap_line(trace((0, 0, 0, 1.0), (0, 50, 5, 1.0), (0, 100, 10, 1.0)), [lap(1, 10_000)], 1)
    # as fast for half a lap, then it loses two seconds
    later = lap_line(trace((0, 0, 0, 1.0), (0, 50, 5, 2.0), (0, 100, 12, 2.0)), [lap(1, 12_000)], 1)
    found = compare(even, later, 20.0)
    assert len(found.metres) == 201 and found.metres[:3] == [0.0, 0.1, 0.2] and found.metres[-1] == 20.0
    assert found.gap_ms[0] == found.gap_ms[100] == 0 and found.gap_ms[150] == 1000 and found.last_gap_ms == 2000
    assert compare(later, even, 20.0).gap_ms == [-gap for gap in found.gap_ms]
    assert found.stretch(gained=True) == (10.0, 12.0, 400) and found.stretch(gained=False)[2] == 0
    assert (found.speed[120], found.other_speed[120]) == (1.0, 2.0)


def test_the_second_lap_has_its_own_clock_and_a_reset_counts_behind_its_place():
    run = [lap(1, 4_000), {**lap(2, 9_000), "start_ms": 4_000}]
    rows = [(0, 0, 0, 1.0), (0, 100, 4.01, 1.0)]
    rows += [(1, 1, 4.1, 1.0), (1, 50, 6, 1.0), (1, 40, 10, 1.0), (1, 60, 11, 1.0), (1, 100, 13.05, 1.0)]
    line = lap_line(trace(*rows), run, 2)
    assert line.percent.tolist() == [0, 1, 50, 60, 100]
    assert line.ms.tolist() == pytest.approx([0, 100, 2000, 7000, 9000])
    assert best_lap(run) == 1


def test_an_unfinished_lap_is_compared_as_far_as_it_came():
    whole = lap_line(trace((0, 0, 0, 1.0), (0, 100, 10, 1.0)), [lap(1, 10_000)], 1)
    half = lap_line(trace((0, 0, 0, 1.0), (0, 40, 3, 1.0)), [lap(1, 3_500, complete=False, percentage=40)], 1)
    found = compare(whole, half, 10.0)
    assert found.metres[-1] == pytest.approx(4.0) and not found.is_whole and found.last_gap_ms == -1000


@pytest.mark.parametrize("number", [0, 2, 99])
def test_a_lap_that_is_not_there_is_refused(number):
    with pytest.raises(UserFault) as refused:
        lap_line(trace((0, 0, 0, 1.0), (0, 100, 10, 1.0)), [lap(1, 10_000)], number)
    assert refused.value.code == "compare_lap"


@pytest.fixture(scope="session")
def kept_compared(request: pytest.FixtureRequest, keep: Callable) -> Kept:
    return keep(request, lambda: _runs(timezone.now()))


@pytest.fixture
def runs(kept_compared: Kept, db: None):
    return kept_compared.copy()


def _runs(now):
    """Of an open race, of a secret one, and of one in the other direction, all driven by Bob but the first."""
    alice, bob, house = a_racer("alice"), a_racer("bob"), a_racer("house", is_house=True)
    public = a_race(now, slug="public", organiser=alice)
    secret = a_race(now, slug="secret", organiser=alice, visibility=Visibility.INVITATION)
    accept_invitation(token=secret.invitation, racer=bob, now=now)
    found = {
        "alice": a_driven_run(public, alice, now, lap_ms=1_200),
        "bob": a_driven_run(public, bob, now, lap_ms=1_000),
        "secret": a_driven_run(secret, bob, now, lap_ms=1_100),
        "house": a_driven_run(public, house, now, lap_ms=1_500),
        "reverse": a_driven_run(a_race(now, slug="reverse", direction="cw"), bob, now),
    }
    waiting = submit_model(race=a_race(now, slug="waits"), racer=bob, model=a_model(bob), now=now)
    return found | {"waiting": waiting.evaluation}


def test_the_list_and_the_check_say_the_same_for_the_whole_cast(runs):
    cast = [Evaluation.objects.get(pk=run.pk).owner for run in (runs["alice"], runs["bob"])]
    cast += [a_racer("charlie"), a_racer("stella", is_staff=True), AnonymousUser()]
    for reader in cast:
        listed = set(comparable_with(runs["alice"], reader))
        allowed = set()
        for run in runs.values():
            try:
                refuse_incomparable(runs["alice"], run)
            except UserFault:
                continue
            if can_see_evaluation(reader, run):
                allowed.add(run)
        assert listed == allowed
        assert runs["bob"] in listed and runs["reverse"] not in listed
    assert set(comparable_with(runs["alice"], AnonymousUser())) == {runs["bob"], runs["house"]}


def test_a_sealed_run_is_with_nothing_compared(runs, now):
    Evaluation.with_sealed.filter(pk=runs["bob"].pk).update(sealed=True)
    stella = a_racer("stella", is_staff=True)
    assert runs["bob"] not in comparable_with(runs["alice"], stella)
    client = Client()
    client.force_login(stella)
    assert client.get(reverse("evaluation_replay", args=[runs["bob"].public_id])).status_code == 404
    assert client.get(reverse("replay", args=[runs["bob"].public_id])).status_code == 404
    at = reverse("replay", args=[runs["alice"].public_id])
    assert refusal(client, f"{at}?with={runs['bob'].public_id}") == "compare_unknown"
    address = f"/api/v1/evaluations/{runs['alice'].public_id}/compare/{runs['bob'].public_id}/"
    assert client.get(address).status_code == 404


def test_what_is_offered_begins_with_the_leader(runs):
    race = runs["alice"].submission.entry.race
    offered = offers_to_compare(runs["alice"], runs["alice"].owner, race)
    assert [(each.why, each.evaluation) for each in offered] == [
        (Why.LEADER, runs["bob"]),
        (Why.HOUSE, runs["house"]),
        (Why.FAST, runs["secret"]),
    ]
    assert offered[0].gap_ms == 999 - 1_199
    assert [each.why for each in offered].count(Why.AHEAD) == 0, "the car ahead leads, and is offered once"
    assert [each.why for each in offers_to_compare(runs["alice"], runs["bob"].owner, None)][:2] == [Why.MINE, Why.MINE]


def test_each_reader_is_offered_what_they_may_see(runs):
    """The readers take turns, with one query that is kept for all racers."""
    run, race = runs["alice"], runs["alice"].submission.entry.race
    charlie, stella = a_racer("charlie"), a_racer("stella", is_staff=True)
    for reader, sees in ((run.owner, True), (charlie, False), (stella, True), (None, False), (runs["bob"].owner, True)):
        for hidden in ((), [race.pk]):
            offered = {each.evaluation for each in offers_to_compare(run, reader, race, hidden)}
            assert (runs["secret"] in offered) == sees
            assert (runs["bob"] in offered) == (not hidden)


def refusal(client, address):
    shown = client.get(address, follow=True)
    return shown.content.decode().partition('data-code="')[2].partition('"')[0]


def test_the_pages_and_the_api_refuse_with_a_reason(runs, client):
    client.force_login(runs["bob"].owner)
    at = reverse("replay", args=[runs["alice"].public_id])
    for other, code, status in (
        (runs["alice"].public_id, "compare_itself", 400),
        ("nothing-there", "compare_unknown", 404),
        (runs["waiting"].public_id, "compare_no_result", 409),
        (runs["reverse"].public_id, "compare_elsewhere", 400),
    ):
        assert refusal(client, f"{at}?with={other}") == code
        answer = client.get(f"/api/v1/evaluations/{runs['alice'].public_id}/compare/{other}/")
        assert answer.status_code == status
        assert code == "compare_unknown" or answer.json()["code"] == code
    link = "https://example.org" + runs["bob"].get_absolute_url()
    assert client.get(at, {"with": link}).url == f"{at}?with={runs['bob'].public_id}"


def test_page_and_api_show_the_same_gap(runs, client):
    address = f"/api/v1/evaluations/{runs['alice'].public_id}/compare/{runs['bob'].public_id}/"
    told = client.get(address).json()
    assert (told["lap"], told["other_lap"], told["gap_ms"][-1]) == (2, 2, 999 - 1_199)
    assert len(told["gap_ms"]) == len(told["metres"]) == len(told["speed"]) == len(told["other_speed"]) == 201
    for wrong in ("0", "4", "x", "-1", "1e1", "٣"):
        assert client.get(address, {"lap": wrong}).json()["code"] == "compare_lap"
    page = client.get(
        reverse("replay", args=[runs["alice"].public_id]), {"with": runs["bob"].public_id, "analysis": "1"}
    )
    assert "bob is 0.200 s ahead of alice at the line." in page.content.decode()
    assert [each["lap"] for each in json.loads(page.context["viewer"])["runs"]] == [2, 2], "the best lap of each"


def test_runs_by_other_rules_have_their_race_and_no_gap(runs, now):
    bob = Evaluation.objects.get(pk=runs["bob"].pk).owner
    boxes = a_race(now, slug="boxes", race_type="object_avoidance", random_boxes=1)
    free = a_race(now, slug="free", off_track_penalty_ms=0)
    others = [a_driven_run(race, bob, now, lap_ms=900) for race in (boxes, free)]
    offered = offers_to_compare(runs["alice"], runs["alice"].owner, None)
    assert not {each.evaluation for each in offered} & set(others)
    mine = {each.evaluation: each for each in offers_to_compare(runs["bob"], bob, None)}
    assert [(mine[run].gap_ms, mine[run].race) for run in others] == [(None, boxes), (None, free)]


def test_a_run_of_another_engine_is_refused_and_not_offered(runs, client):
    Result.objects.filter(evaluation=runs["bob"]).update(engine="paddock-v0")
    alice = Evaluation.objects.get(pk=runs["alice"].pk)
    assert runs["bob"] not in comparable_with(alice, alice.owner)
    client.force_login(alice.owner)
    at = reverse("replay", args=[alice.public_id])
    assert refusal(client, f"{at}?with={runs['bob'].public_id}") == "compare_engine"
    answer = client.get(f"/api/v1/evaluations/{alice.public_id}/compare/{runs['bob'].public_id}/")
    assert (answer.status_code, answer.json()["code"]) == (400, "compare_engine")


def test_addresses_of_earlier_versions_lead_to_the_viewer(runs, client):
    alice, bob = runs["alice"].public_id, runs["bob"].public_id
    moved = {
        f"/evaluations/{alice}/compare/": f"/evaluations/{alice}/replay/#offers",
        f"/evaluations/{alice}/compare/?with=ahead": f"/evaluations/{alice}/replay/?with=ahead",
        f"/evaluations/{alice}/compare/{bob}/": f"/evaluations/{alice}/replay/?with={bob}",
        f"/evaluations/{alice}/compare/{bob}/?lap=3&other_lap=1": f"/evaluations/{alice}/replay/?lap=3&with={bob}:1",
    }
    for before, now in moved.items():
        answer = client.get(before)
        assert (answer.status_code, answer.url) == (301, now)


def test_words_name_the_runs_to_add(runs, client, now):
    client.force_login(runs["alice"].owner)
    at = reverse("replay", args=[runs["alice"].public_id])
    for word in ("ahead", "leader"):
        assert client.get(at, {"with": word}).url == f"{at}?with={runs['bob'].public_id}"
    assert client.get(at, {"with": "house", "t": "2"}).url == f"{at}?with={runs['house'].public_id}&t=2"
    assert client.get(at, {"with": "mine"}).url == at, "there is no other run of the racer"
    Follow.objects.create(follower=runs["alice"].owner, followed=runs["house"].owner, since=now)
    assert client.get(at, {"with": "followed"}).url == f"{at}?with={runs['house'].public_id}"


def test_at_most_eight_runs_play_together(runs, client, now):
    race = runs["alice"].submission.entry.race
    more = [a_driven_run(race, a_racer(f"racer{number}"), now, count=1) for number in range(8)]
    client.force_login(runs["alice"].owner)
    at = reverse("replay", args=[runs["alice"].public_id])
    page = client.get(at, {"with": ",".join(run.public_id for run in more)}, follow=True)
    assert len(page.context["runs"]) == 8 and page.context["offers"] == []
    assert len({each.look.colour for each in page.context["runs"]}) == 8, "each has its own colour"


def test_more_runs_need_no_more_queries(runs, client, now):
    race = runs["alice"].submission.entry.race
    more = [a_driven_run(race, a_racer(f"racer{number}"), now, count=1) for number in range(7)]
    client.force_login(runs["alice"].owner)
    at = reverse("replay", args=[runs["alice"].public_id])

    def queries(count: int) -> int:
        with CaptureQueriesContext(connection) as captured:
            assert client.get(at, {"with": ",".join(run.public_id for run in more[:count])}).status_code == 200
        return len(captured)

    queries(1)
    files = 2 * 5  # a test's transaction keeps no trace for the telemetry
    assert queries(6) <= queries(1) + files


def test_many_words_cost_no_more_than_one(runs, client):
    at = reverse("replay", args=[runs["alice"].public_id])

    def queries(words: list[str]) -> int:
        with CaptureQueriesContext(connection) as captured:
            client.get(at, {"with": ",".join(words)})
        return len(captured)

    queries(["fast"])
    assert queries(["fast", "leader"] * 200) <= queries(["fast"]) + 1


def test_only_a_faster_car_is_ahead_and_only_a_racer_leads(runs):
    def whys(name: str) -> dict[str, Why]:
        run = runs[name]
        return {offer.evaluation.owner.alias: offer.why for offer in offers_to_compare(run, None, race_of(run))}

    assert whys("bob").get("alice") == Why.FAST
    assert whys("alice")["bob"] == Why.LEADER
    assert Why.HOUSE in whys("bob").values()
