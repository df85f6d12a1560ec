"""What is left of a live event: figures, CSV, PDF, certificates; and who gets them."""

from __future__ import annotations

import csv
import io
from datetime import timedelta

import pytest
from django.urls import reverse
from django.utils import timezone

from paddock.errors import UserFault
from races.aftermath import views
from races.aftermath.certificate import certificate, placed
from races.aftermath.highlights import moments_of
from races.aftermath.pdf import Paper
from races.aftermath.results import event_csv, laps_csv, results_pdf
from races.aftermath.watch_again import again_document
from races.live.selectors.runs import driven_runs
from races.live.services import cancel_live, end_live
from races.live.statistics import figure_words, figures_of
from races.models import Entry, LiveRacer, LiveState, Race, Visibility
from tests.clients import logged_in
from tests.factories import a_race, a_racer
from tests.live_shows import a_live_race, a_show, an_ended_show, begun, compute, slot_of
from tests.races.test_live_duels import a_live_draw, show_next
from tests.races.test_live_duels import begun as drawn_and_begun

pytestmark = pytest.mark.django_db
ADDRESS = "https://paddock.example/races/race-night/"


@pytest.fixture
def alice():
    return a_racer("alice")


def test_an_event_in_figures(alice, now):
    event = an_ended_show(now, alice)
    places = {"bob": 1, "carl": 3, "dora": 2}
    for name, place in places.items():
        LiveRacer.objects.filter(entry__racer__alias=name).update(qualified_rank=place)
    figures = figures_of(event)
    assert (figures.runs, figures.without_result, figures.laps) == (3, 0, 6)
    assert (figures.fastest.racer, figures.fastest.time_ms) == ("carl", 8_000)
    assert figures.lead_changes == 1
    assert (figures.gain.racer, figures.gain.before, figures.gain.after) == ("carl", 3, 1)
    assert figures.closest_ms == 500
    assert figures.average_mps == pytest.approx(6 * event.race.track.length_m / 53.6)
    assert [(one.racer, one.laps, one.average_ms) for one in figures.racers] == [
        ("carl", 1, 8_000),
        ("dora", 3, 9_067),
        ("bob", 2, 9_200),
    ]
    assert ("Changes of the lead", "1") in figure_words(figures)


def test_an_event_without_a_run_has_figures_too(alice, now):
    event = begun(a_show(now, alice, ["bob"]), alice, now)
    figures = figures_of(event)
    assert (figures.runs, figures.laps, figures.fastest, figures.average_mps) == (0, 0, None, None)
    assert figure_words(figures)


def test_results_and_laps_as_csv(alice, now):
    event = an_ended_show(now, alice)
    rows = list(csv.DictReader(io.StringIO("".join(event_csv(event)))))
    assert [(row["rank"], row["racer"], row["score_ms"], row["gap_ms"]) for row in rows] == [
        ("1", "carl", "8000", "0"),
        ("2", "dora", "8500", "500"),
        ("3", "bob", "9000", "1000"),
    ]
    driven = list(csv.DictReader(io.StringIO("".join(laps_csv(event)))))
    assert [(row["run"], row["racer"], row["lap"], row["time_ms"]) for row in driven][:3] == [
        ("1", "bob", "1", "9000"),
        ("1", "bob", "2", "9400"),
        ("2", "carl", "1", "8000"),
    ]
    assert sum(int(driven[2][f"sector_{number}_ms"]) for number in (1, 2, 3)) == 8_000


def test_a_certificate_says_the_place_in_the_event(alice, now):
    event = an_ended_show(now, alice)
    entry = Entry.objects.get(race=event.race, racer__alias="dora")
    said = placed(event.race, entry, now)
    assert (said.racer, said.rank, said.of, said.score) == ("dora", 2, 3, "Best lap: 0:08.500")
    assert certificate(said, ADDRESS).startswith(b"%PDF-")


def test_who_has_no_place_has_no_certificate(alice, now):
    event = an_ended_show(now, alice, laps={"bob": (9_000,), "carl": ()})
    with pytest.raises(UserFault) as fault:
        placed(event.race, Entry.objects.get(race=event.race, racer__alias="carl"), now)
    assert fault.value.code == "certificate_no_place"


def test_nothing_is_handed_out_before_the_end(alice, now):
    event = an_ended_show(now, alice, end=False)
    for make in (
        lambda: results_pdf(event.race, now, ADDRESS),
        lambda: placed(event.race, Entry.objects.filter(race=event.race).first(), now),
    ):
        with pytest.raises(UserFault) as fault:
            make()
        assert fault.value.code == "results_not_yet"
    client = logged_in(None)
    answer = client.get(reverse("live_results_csv", args=[event.race.slug]), follow=True)
    assert "results_not_yet" in answer.content.decode()


def test_an_event_that_was_called_off_leaves_the_board(alice, now):
    event = a_show(now, alice, ["bob"])
    cancel_live(event=event, by=alice, seen=event.version, now=now)
    race = event.race
    race.refresh_from_db()
    race.closes_at = now
    race.save()
    assert results_pdf(race, now + timedelta(seconds=1), ADDRESS).startswith(b"%PDF-")


def test_korean_letters_are_in_the_file():
    from core.cards.lettering import is_drawable

    if not is_drawable("결과"):
        pytest.fail("fonts-noto-cjk is missing: make setup installs it")
    paper = Paper()
    wide = paper.write("결과 한글", 20, 20, 12)
    assert wide > paper.write("...", 20, 30, 12)
    data = paper.bytes()
    assert b"/FontFile" in data
    assert b"/ToUnicode" in data


def test_hostile_names_make_a_file(alice, now):
    paper = Paper()
    for text in ("\U0001f3c1 \x00\u202e)(\\", "x" * 4000, "", "العربية", "ł–…"):
        paper.write(text, 10, 10, 12, most=50)
    assert paper.bytes().startswith(b"%PDF-")


def _files(event) -> list[str]:
    slug = event.race.slug
    return [
        reverse("race_results_pdf", args=[slug]),
        reverse("race_certificate", args=[slug, "bob"]),
        reverse("live_results_csv", args=[slug]),
        reverse("live_laps_csv", args=[slug]),
    ]


def test_who_gets_the_files_of_a_private_event(alice, now):
    now = timezone.now()
    race = a_live_race(now, alice)
    event = an_ended_show(now, alice, laps={"bob": (9_000,)}, race=race)
    Race.objects.update(visibility=Visibility.INVITATION)
    bob = Entry.objects.get(race=race).racer
    for viewer in (None, a_racer("mallory")):
        assert {logged_in(viewer).get(each).status_code for each in _files(event)} == {404}
    for viewer in (alice, bob, a_racer("stella", is_staff=True)):
        client = logged_in(viewer)
        for each in _files(event):
            answer = client.get(each)
            assert answer.status_code == 200, each
            assert "attachment" in answer["Content-Disposition"]
    page = logged_in(bob).get(reverse("live_event", args=[race.slug])).content.decode()
    assert reverse("race_certificate", args=[race.slug, "bob"]) in page
    assert "Changes of the lead" in page


def test_who_asks_for_too_many_papers_waits(alice, now, monkeypatch):
    monkeypatch.setattr(views, "results_pdf", lambda *told: b"%PDF-")
    event = an_ended_show(timezone.now(), alice, laps={"bob": (9_000,)})
    client = logged_in(a_racer("zoe"))
    found = [client.get(_files(event)[0]).status_code for _ in range(21)]
    assert found == [200] * 20 + [429]


def test_a_racer_who_left_has_no_certificate_and_unknown_ones_are_404(alice, now):
    event = an_ended_show(timezone.now(), alice, laps={"bob": (9_000,)})
    client = logged_in(None)
    assert client.get(reverse("race_certificate", args=[event.race.slug, "nobody"])).status_code == 404
    Entry.objects.filter(race=event.race).update(withdrawn_at=timezone.now())
    assert client.get(reverse("race_certificate", args=[event.race.slug, "bob"])).status_code == 404


def test_runs_that_were_not_shown_are_no_part_of_it(alice, now):
    event = an_ended_show(now, alice, laps={"bob": (9_000,)}, end=False)
    assert [run.alias for run in driven_runs(event)] == ["bob"]
    other = begun(a_show(now, alice, ["carl"], race=a_race(now, organiser=alice)), alice, now)
    compute(slot_of(other, "carl"), now, 30_000)
    assert driven_runs(other) == []
    assert other.state == LiveState.RUNNING


def test_duels_have_figures_highlights_and_are_watched_again(alice, now):
    """Heats are runs of several cars; nobody leads by time."""
    event, at = drawn_and_begun(a_live_draw(now, alice, 3), alice)
    for _ in range(4):
        at = show_next(event, alice, at)
    end_live(event=event, by=alice, seen=None, now=at)
    event.refresh_from_db()
    runs = driven_runs(event)
    assert len(runs) == 8
    assert [run.alias for run in runs[:4]] == ["car-2", "car-3", "car-3", "car-2"]
    figures = figures_of(event)
    assert (figures.runs, figures.lead_changes, figures.closest_ms) == (8, None, None)
    assert figures.laps == sum(len(run.complete) for run in runs) > 0
    told = again_document(event, at)
    assert [len(step["state"]["current"]["cars"]) for step in told["steps"]] == [2] * 4
    assert told["steps"][0]["state"]["standings"][0]["rank"] is None
    assert told["steps"][-1]["after"]["standings"][0]["points"] > 0
    assert told["end"]["podium"][0] == "car-1"
    assert "".join(laps_csv(event)).count("\r\n") == 1 + sum(len(run.laps) for run in runs)
    entry = Entry.objects.get(race=event.race, racer__alias="car-1")
    assert placed(event.race, entry, at).rank == 1
    closest = next((one for one in moments_of(event) if one.kind == "closest"), None)
    assert closest is None or closest.run.slot.duel_id is not None
