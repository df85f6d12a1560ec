"""What a racer and an organiser do on the race pages."""

from __future__ import annotations

import csv
import io
import re
from datetime import UTC, datetime, timedelta

import pytest
from django.utils import timezone

from evaluation.models import Evaluation
from paddock.errors import PlatformFault
from races.aftermath import views as afterwards
from races.models import Entry, Race, RankingMethod, Submission
from tests.factories import a_model, a_race, a_racer, drive, laps
from tests.league.seasons import stand
from tests.pages.conftest import World


def form(now: datetime, **changes: object) -> dict[str, object]:
    """A time trial's form as a browser sends it: without the fields of the other types, which stand disabled."""
    data: dict[str, object] = {
        "name": "Friday night",
        "description": "",
        "track": "oval",
        "direction": "cw",
        "race_type": "time_trial",
        "sensors": ["FRONT_FACING_CAMERA"],
        "opens_at": now.strftime("%Y-%m-%dT%H:%M"),
        "closes_at": (now + timedelta(days=3)).strftime("%Y-%m-%dT%H:%M"),
        "time_zone": "UTC",
        "laps": "4",
        "minimum_laps": "2",
        "ranking_method": "average",
        "off_track_penalty_ms": "2.5",
        "max_resets": "10",
        "max_simulated_ms": "120",
        "max_submissions": "7",
        "visibility": "public",
    }
    return data | changes


def row_of(html: str, alias: str) -> str:
    """The row of the board that shows ``alias``."""
    return next(row for row in re.findall(r"<tr class=\"linked.*?</tr>", html, re.S) if f">{alias}</a>" in row)


def test_the_board_shows_ranks_times_and_gaps_and_marks_my_row(world: World) -> None:
    html = world.client("bob").get("/races/open-race/").content.decode()
    leader, mine, house, slow = (row_of(html, alias) for alias in ("alice", "bob", "house-steady", "slowpoke"))
    assert '<td class="place">1' in leader and "0:10.100" in leader and "0:10.000" in leader and "leader" in leader
    assert 'class="sector purple"' in leader
    assert '<td class="place">2' in mine and "+1.000" in mine and 'aria-current="true"' in mine and ">you<" in mine
    assert "baseline" in house and "not ranked" in house
    assert "unclassified" in slow
    assert (
        html.index(">alice</a>")
        < html.index(">house-steady</a>")
        < html.index(">bob</a>")
        < html.index(">slowpoke</a>")
    )
    assert "not classified" in html


def test_a_visitor_who_is_not_on_the_board_sees_no_row_marked(world: World) -> None:
    html = world.client("newcomer").get("/races/open-race/").content.decode()
    assert ">you<" not in html


def test_my_row_is_pinned_when_it_is_on_another_page(world: World) -> None:
    for number in range(55):
        stand(world.race, a_racer(), 8_000 + number)
    html = world.client("alice").get("/races/open-race/").content.decode()
    assert "further down" in html
    assert row_of(html, "alice").count("56") >= 1
    second = world.client("alice").get("/races/open-race/?page=2").content.decode()
    assert "further down" not in second and ">alice</a>" in second


@pytest.mark.parametrize("method", RankingMethod.values)
def test_each_ranking_method_explains_itself_and_marks_its_column(world: World, method: str) -> None:
    Race.objects.filter(pk=world.race.pk).update(ranking_method=method)
    html = world.client("anonymous").get("/races/open-race/").content.decode()
    assert "Ranked by the" in html
    marked = re.findall(r'aria-sort="ascending"[^>]*>([^<]+)<', html)
    assert marked == [{"average": "Average", "best": "Best lap", "total": "Total"}[method]]


def test_the_board_as_csv_and_json_matches_the_page(world: World) -> None:
    client = world.client("anonymous")
    response = client.get("/races/open-race/board.csv")
    rows = list(csv.DictReader(io.StringIO(b"".join(response).decode())))
    assert response["Content-Type"].startswith("text/csv")
    assert [row["racer"] for row in rows] == ["alice", "house-steady", "bob", "slowpoke"]
    assert rows[0] | {"rank": "1", "average_ms": "10100", "best_lap_ms": "10000", "gap_ms": "0"} == rows[0]
    assert (rows[1]["rank"], rows[1]["baseline"]) == ("", "1")
    assert (rows[3]["rank"], rows[3]["classified"]) == ("", "0")
    data = client.get("/races/open-race/board.json").json()
    assert data["race"] == "open-race" and data["state"] == "open"
    assert [row["racer"] for row in data["rows"]] == [row["racer"] for row in rows]
    assert data["rows"][0]["sector_1_ms"] == int(rows[0]["sector_1_ms"])


def test_a_racer_enters_submits_and_withdraws(world: World) -> None:
    client = world.client("newcomer")
    model = a_model(world.newcomer, name="First car")
    assert "First car" in client.get("/races/open-race/").content.decode()
    html = client.post("/races/open-race/submit/", {"model": model.public_id}, follow=True).content.decode()
    assert "Your car is queued" in html and "First car" in html
    submission = Submission.objects.get(entry__racer=world.newcomer)
    again = client.post("/races/open-race/submit/", {"model": model.public_id}, follow=True).content.decode()
    assert 'data-code="car_already_submitted"' in again
    assert client.get("/races/open-race/withdraw/").status_code == 200
    client.post("/races/open-race/withdraw/")
    submission.entry.refresh_from_db()
    assert submission.entry.withdrawn_at is not None
    html = client.get("/races/open-race/").content.decode()
    assert "Enter again" in html
    client.post("/races/open-race/enter/")
    submission.entry.refresh_from_db()
    assert submission.entry.withdrawn_at is None


def test_a_submitted_car_is_not_offered_again(world: World) -> None:
    html = world.client("bob").get("/races/open-race/").content.decode()
    offered = re.findall(r'<option value="(\w+)"', html)
    sent = Submission.objects.get(entry__race=world.race, entry__racer=world.bob).evaluation.model.public_id
    assert sent not in offered


def test_an_error_is_shown_in_words_with_its_code(world: World) -> None:
    client = world.client("alice")
    response = client.post("/races/old-race/submit/", {"model": world.model.public_id}, follow=True)
    html = response.content.decode()
    assert 'data-code="race_closed"' in html and "The race closed at" in html
    client.cookies["django_language"] = "ko"
    korean = client.post("/races/old-race/submit/", {"model": world.model.public_id}, follow=True).content.decode()
    assert 'data-code="race_closed"' in korean and "마감되었습니다" in korean


def test_an_error_from_the_model_page_leads_back_to_it(world: World) -> None:
    client = world.client("alice")
    model = world.queued.evaluation.model
    data = {"model": model.public_id, "from": "model"}
    response = client.post("/races/waiting-race/submit/", data)
    assert response["Location"] == f"/models/{model.public_id}/"


def test_a_racer_creates_a_race_and_finds_it(world: World) -> None:
    client = world.client("newcomer")
    now = timezone.now().astimezone(UTC)
    response = client.post("/races/new/", form(now))
    race = Race.objects.get(name="Friday night")
    assert response["Location"] == f"/races/{race.slug}/"
    assert (race.organiser, race.kind, race.direction, race.laps, race.minimum_laps) == (
        world.newcomer,
        "community",
        "cw",
        4,
        2,
    )
    assert (race.off_track_penalty_ms, race.max_simulated_ms, race.max_submissions) == (2500, 120_000, 7)
    assert race.collision_penalty_ms == Race().collision_penalty_ms
    html = client.get(response["Location"]).content.decode()
    assert "Off track: back on the lane after 2.5 s." in html
    assert "Friday night" in client.get("/races/").content.decode()


def test_editing_a_time_trial_keeps_its_hidden_collision_penalty(world: World) -> None:
    client, now = world.client("newcomer"), timezone.now().astimezone(UTC)
    client.post("/races/new/", form(now + timedelta(hours=1)))
    Race.objects.filter(name="Friday night").update(collision_penalty_ms=7000)
    race = Race.objects.get(name="Friday night")
    data = form(now + timedelta(hours=1), laps="5", collision_penalty_ms="no number")
    assert client.post(f"/races/{race.slug}/edit/", data).status_code == 302
    race.refresh_from_db()
    assert (race.laps, race.collision_penalty_ms) == (5, 7000)


def test_times_are_read_in_the_time_zone_that_the_page_names(world: World) -> None:
    now = timezone.now().astimezone(UTC).replace(second=0, microsecond=0)
    seoul = now + timedelta(hours=9)
    world.client("newcomer").post("/races/new/", form(seoul, time_zone="Asia/Seoul"))
    assert Race.objects.get(name="Friday night").opens_at == now
    world.client("newcomer").post("/races/new/", form(now, name="Second", time_zone="Not/AZone"))
    assert Race.objects.get(name="Second").opens_at == now


@pytest.mark.parametrize(
    ("changes", "field", "code"),
    [
        ({"minimum_laps": "9"}, "minimum_laps", "race_minimum_laps"),
        ({"ranking_method": "total"}, "minimum_laps", "race_total_needs_all_laps"),
        ({"closes_at": "2020-01-01T00:00"}, "closes_at", "race_closes_before_opening"),
        ({"opens_at": "2020-01-01T00:00"}, "opens_at", "race_opens_in_the_past"),
        ({"track": "nothing"}, "track", "invalid_choice"),
        ({"laps": "0"}, "laps", "min_value"),
        ({"laps": "x"}, "laps", "invalid"),
        ({"name": ""}, "name", "required"),
        ({"name": "x" * 65}, "name", "max_length"),
        ({"opens_at": "tomorrow"}, "opens_at", "invalid"),
        ({"off_track_penalty_ms": "61"}, "off_track_penalty_ms", "max_value"),
        ({"off_track_penalty_ms": "NaN"}, "off_track_penalty_ms", "invalid"),
        ({"visibility": "nonsense"}, "visibility", "invalid_choice"),
        ({"time_zone": "../../etc/passwd", "laps": "x"}, "laps", "invalid"),
    ],
)
def test_an_invalid_race_form_shows_errors_beside_the_fields(world: World, changes, field: str, code: str) -> None:
    now = timezone.now().astimezone(UTC)
    response = world.client("newcomer").post("/races/new/", form(now, **changes))
    assert response.status_code == 422
    assert code in [error.code for error in response.context["form"].errors[field].as_data()]
    assert not Race.objects.filter(organiser=world.newcomer).exists()
    assert f'id="id_{field}_error"' in response.content.decode()


def test_a_race_with_submissions_can_be_renamed_but_keeps_its_rules(world: World) -> None:
    client = world.client("alice")
    page = client.get("/races/open-race/edit/").content.decode()
    assert (
        re.search(r'name="off_track_penalty_ms"[^>]*disabled', page)
        and "Cars have been submitted under these rules" in page
    )
    forged = form(timezone.now().astimezone(UTC), name="New name", off_track_penalty_ms="1", laps="9")
    response = client.post("/races/open-race/edit/", forged)
    assert response.status_code == 302, response.context["form"].errors
    before = (world.race.off_track_penalty_ms, world.race.laps, world.race.max_simulated_ms, world.race.opens_at)
    world.race.refresh_from_db()
    after = (world.race.off_track_penalty_ms, world.race.laps, world.race.max_simulated_ms, world.race.opens_at)
    assert world.race.name == "New name" and after == before


def test_saving_a_race_untouched_changes_nothing(world: World) -> None:
    client = world.client("admin")
    for race in (world.secret, world.upcoming, world.closed):
        before = Race.objects.filter(pk=race.pk).values().get()
        initial = client.get(f"/races/{race.slug}/edit/").context["form"]
        data = {field.html_name: field.value() for field in initial}
        data |= {name: data[name].strftime("%Y-%m-%dT%H:%M") for name in ("opens_at", "closes_at")}
        response = client.post(f"/races/{race.slug}/edit/", data)
        assert response.status_code == 302, response.context["form"].errors
        assert Race.objects.filter(pk=race.pk).values().get() == before


def test_a_new_invitation_link_replaces_the_old_one(world: World) -> None:
    bob = world.client("bob")
    path = f"/races/join/{world.secret.invitation}/"
    assert bob.get("/races/secret-race/").status_code == 404
    assert "Secret race" in bob.get(path).content.decode()
    assert bob.post(path)["Location"] == "/races/secret-race/"
    assert bob.get("/races/secret-race/").status_code == 200
    assert bob.get(path)["Location"] == "/races/secret-race/"
    world.client("alice").post("/races/secret-race/invitation/reset/")
    assert world.client("newcomer").get(path).status_code == 404
    assert world.client("newcomer").post(path).status_code == 404
    assert bob.get("/races/secret-race/").status_code == 200


def test_an_invitation_asks_a_guest_to_log_in_first(world: World) -> None:
    path = f"/races/join/{world.secret.invitation}/"
    response = world.client("anonymous").post(path, headers={"referer": f"http://testserver{path}"})
    assert response["Location"] == f"/accounts/login/?next={path}"
    assert not Entry.objects.filter(race=world.secret).exists()


def test_the_invitation_link_of_a_race_made_public_is_dead(world: World) -> None:
    assert world.client("bob").get(f"/races/join/{world.race.invitation}/").status_code == 404


def test_an_organiser_removes_a_racer_and_restores_them(world: World) -> None:
    alice = world.client("alice")
    assert alice.post("/races/open-race/racers/bob/remove/", {"reason": ""}).status_code == 422
    alice.post("/races/open-race/racers/bob/remove/", {"reason": "Two accounts"})
    entry = Entry.objects.get(race=world.race, racer=world.bob)
    assert entry.removed_at is not None and entry.removal_reason == "Two accounts"
    assert ">bob</a>" not in world.client("anonymous").get("/races/open-race/").content.decode()
    assert "The organiser has removed you" in world.client("bob").get("/races/open-race/").content.decode()
    assert "Two accounts" in alice.get("/races/open-race/racers/").content.decode()
    alice.post("/races/open-race/racers/bob/restore/")
    assert ">bob</a>" in world.client("anonymous").get("/races/open-race/").content.decode()


def test_cancelling_needs_a_reason_that_everybody_reads(world: World) -> None:
    alice = world.client("alice")
    assert alice.post("/races/open-race/cancel/", {"reason": " "}).status_code == 422
    alice.post("/races/open-race/cancel/", {"reason": "The track is flooded."})
    html = world.client("anonymous").get("/races/open-race/").content.decode()
    assert "The track is flooded." in html and "cancelled" in html


def test_closing_a_race_now_keeps_what_was_sent_in_time(world: World) -> None:
    alice, race = world.client("alice"), world.race
    page = alice.get("/races/open-race/")
    assert "/races/open-race/close/" in page.content.decode()
    assert "/races/open-race/close/" not in world.client("bob").get("/races/open-race/").content.decode()
    asked = alice.get("/races/open-race/close/").content.decode()
    assert "No more cars can be submitted" in asked
    race.refresh_from_db()
    assert race.closes_at > world.now, "nothing is done before it is said"
    waiting = list(Evaluation.objects.filter(state="queued").values_list("pk", flat=True))
    assert alice.post("/races/open-race/close/").status_code == 302
    race.refresh_from_db()
    assert race.state_at(timezone.now()) == "closed" and race.cancelled_at is None
    assert list(Evaluation.objects.filter(state="queued").values_list("pk", flat=True)) == waiting
    again = alice.post("/races/open-race/close/", follow=True).content.decode()
    assert "race_closed" in again and "/races/open-race/close/" not in again


@pytest.mark.parametrize("slug, code", [("next-race", "race_not_open_yet"), ("no-race", "race_cancelled")])
def test_only_an_open_race_can_be_closed_now(world: World, slug: str, code: str) -> None:
    race = Race.objects.get(slug=slug)
    assert code in world.client("admin").post(f"/races/{slug}/close/", follow=True).content.decode()
    assert Race.objects.get(slug=slug).closes_at == race.closes_at
    assert "The race is not open." in world.client("admin").get(f"/races/{slug}/close/").content.decode()


def test_the_live_box_polls_only_while_something_happens(world: World) -> None:
    client = world.client("alice")
    page = client.get("/races/waiting-race/").content.decode()
    asked_first = re.search(
        r'hx-get="(/races/waiting-race/live/\?seen=[^"]+)"\s+hx-trigger="load, paddock:moved"', page
    )
    box = client.get(asked_first[1]).content.decode()
    polled = re.search(r'hx-get="(/races/waiting-race/live/\?seen=[^"]+)"\s+hx-trigger="paddock:moved"', box)
    assert polled and "In queue: next." in box
    unchanged = client.get(polled[1])
    assert (unchanged.status_code, unchanged.content) == (204, b"")
    from tests.factories import finish

    finish(world.queued, laps(9_000, 9_100, 9_200), world.now)
    done = client.get(polled[1])
    assert done["HX-Trigger"] == "paddock:raced"
    html = done.content.decode()
    assert "0:09.000" in html and "hx-get" not in html


def test_the_board_and_the_facts_beside_it_refresh_together(world: World) -> None:
    html = world.client("alice").get("/races/open-race/").content.decode()
    followed = re.findall(r'id="(?:board|race-facts)" data-follow="([^"]+)"', html)
    assert followed == [f"race:{world.race.pk}"] * 2
    beside = html[html.index('id="race-facts"') :]
    assert html.count('id="race-facts"') == 1 and "Classified" in beside and "Position" in beside


def test_a_race_with_no_submissions_left_offers_no_form(world: World) -> None:
    race = a_race(world.now, slug="one-shot", max_submissions=1)
    drive(race, world.alice, laps(9_000, 9_000, 9_000), world.now)
    html = world.client("alice").get("/races/one-shot/").content.decode()
    assert "You have used all your submissions" in html and 'name="model"' not in html


@pytest.mark.parametrize("opens_in_days", [-1, 1])
def test_a_race_of_the_other_division_offers_no_button(world: World, opens_in_days: int) -> None:
    opens_at = world.now + timedelta(days=opens_in_days)
    pro = a_race(
        world.now, slug="pro-race", kind="league", division="pro", opens_at=opens_at, closes_at=opens_at + timedelta(9)
    )
    client = world.client("alice")
    page = client.get(pro.get_absolute_url()).content.decode()
    assert "pro division" in page
    assert 'id="send"' not in page and "#send" not in page and "/enter/" not in page
    assert "pro-race" not in client.get(world.model.get_absolute_url()).content.decode()
    assert "open-race" in client.get(world.model.get_absolute_url()).content.decode()


def test_a_stale_race_form_does_not_undo_another_change(world: World) -> None:
    client = world.client("admin")
    path = f"/races/{world.upcoming.slug}/edit/"
    page = client.get(path).context["form"]
    data = {field.html_name: field.value() for field in page}
    data |= {name: data[name].strftime("%Y-%m-%dT%H:%M") for name in ("opens_at", "closes_at")}
    assert data["edition"]
    Race.objects.filter(pk=world.upcoming.pk).update(max_submissions=3)
    answer = client.post(path, data | {"name": "Mine"})
    assert answer.status_code == 422 and 'data-code="race_changed_meanwhile"' in answer.content.decode()
    world.upcoming.refresh_from_db()
    assert (world.upcoming.max_submissions, world.upcoming.name) != (data["max_submissions"], "Mine")
    assert world.upcoming.max_submissions == 3
    fresh = client.get(path).context["form"]
    assert client.post(path, data | {"name": "Mine", "edition": fresh["edition"].value()}).status_code == 302


def resets_field(response) -> str:
    """The value that the field for resets shows."""
    field = re.search(r'<input[^>]*name="max_resets"[^>]*>', response.content.decode())[0]
    value = re.search(r'value="([^"]*)"', field)
    return value[1] if value else ""


def test_unlimited_resets_are_an_empty_field_and_a_word(world: World) -> None:
    client = world.client("alice")
    assert resets_field(client.get("/races/new/")) == ""
    client.post("/races/new/", form(world.now, max_resets="", name="Without limit"))
    race = Race.objects.get(name="Without limit")
    assert race.max_resets == 10_000
    assert "unlimited" in client.get(f"{race.get_absolute_url()}rules/").content.decode()
    assert resets_field(client.get(f"{race.get_absolute_url()}edit/")) == ""
    client.post("/races/new/", form(world.now, max_resets="3", name="With a limit"))
    assert resets_field(client.get(f"{Race.objects.get(name='With a limit').get_absolute_url()}edit/")) == "3"


def test_a_form_error_is_a_sentence_without_its_code(world: World) -> None:
    html = world.client("anonymous").post("/accounts/login/", {"login": "alice", "password": "wrong"}).content.decode()
    assert 'data-code="username_password_mismatch"' in html or "are not correct" in html
    assert ">username_password_mismatch<" not in html


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (
            {"name": "", "opens_at": "2019-12-01T00:00", "closes_at": "2020-01-01T00:00"},
            {"name", "closes_at", "opens_at"},
        ),
        ({"laps": "x", "opens_at": "tomorrow", "closes_at": "2020-01-01T00:00"}, {"laps", "opens_at", "closes_at"}),
        ({"name": "", "laps": "2", "minimum_laps": "3"}, {"name", "minimum_laps"}),
        ({"name": "", "laps": "x", "minimum_laps": "9"}, {"name", "laps"}),
        (
            {"name": "", "race_type": "object_avoidance", "box_choice": "fixed", "boxes-1-percent": "0.1"},
            {"name", "boxes"},
        ),
        ({"track": "nothing", "race_type": "object_avoidance", "box_choice": "drawn", "random_boxes": "8"}, {"track"}),
        (
            {"name": "", "physical": "on", "race_type": "head_to_head", "opponents": "models"},
            {"name", "race_type", "duel_format"},
        ),
        ({"visibility": "nonsense", "opens_at": "2020-01-01T00:00"}, {"visibility", "opens_at", "closes_at"}),
    ],
)
def test_a_race_form_reports_all_problems_at_once(world: World, changes: dict, expected: set[str]) -> None:
    answer = world.client("newcomer").post("/races/new/", form(timezone.now().astimezone(UTC), **changes))
    assert answer.status_code == 422 and set(answer.context["form"].errors) == expected


def test_a_changed_race_reports_all_problems_at_once(world: World) -> None:
    now = timezone.now().astimezone(UTC)
    sent = form(now, name="", opens_at="2020-01-01T00:00", closes_at="2020-01-02T00:00")
    answer = world.client("admin").post(f"/races/{world.upcoming.slug}/edit/", sent)
    assert answer.status_code == 422
    assert set(answer.context["form"].errors) >= {"name", "opens_at", "closes_at"}


def test_a_platform_fault_is_a_503_and_no_message(world: World, monkeypatch) -> None:
    def fail(*_args: object) -> bytes:
        raise PlatformFault("storage_failed")

    monkeypatch.setattr(afterwards, "results_pdf", fail)
    answer = world.client("alice").get(f"/races/{world.closed.slug}/results.pdf")
    assert (answer.status_code, answer["Retry-After"]) == (503, "30")
