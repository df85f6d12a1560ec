"""The card of a run's page that offers, follows and shows its videos."""

from __future__ import annotations

import re
from html.parser import HTMLParser

import pytest
from django.utils import timezone

from tests.drawn_runs import a_driven_run
from tests.duels import a_duel_race, driving, end, qualify
from tests.pages.conftest import World
from videos.models import Video
from videos.services import VIDEOS, request_video, run_next_video

HTMX = {"HTTP_HX_REQUEST": "true"}


@pytest.fixture
def run(world: World, video_wakes):
    """Alice's on the board of the public race."""
    return world.evaluation("finished")


def page_of(world: World, viewer: str, run, query: str = "") -> str:
    return world.client(viewer).get(f"/evaluations/{run.public_id}/{query}").content.decode()


def ask(world: World, run, viewer: str = "newcomer", what: str = "0:best", **more):
    return world.client(viewer).post(f"/evaluations/{run.public_id}/video/", {"what": what}, **more)


class _Options(HTMLParser):
    def __init__(self, html: str) -> None:
        super().__init__()
        self.values: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        if tag == "option" and ":" in (dict(attrs).get("value") or ""):
            self.values.append(dict(attrs)["value"])


def test_members_are_offered_the_best_lap_then_the_run_then_laps(world, run):
    assert _Options(page_of(world, "newcomer", run)).values == ["0:1", "0:whole", "0:2", "0:3"]
    html = page_of(world, "newcomer", run)
    assert "Best lap (1) · 0:10.000" in html and "Make a video" in html


def test_a_guest_watches_ready_videos_but_cannot_request_any(world, run):
    assert 'id="video"' not in page_of(world, "anonymous", run)
    ask(world, run)
    assert "In queue: next." in page_of(world, "anonymous", run)
    run_next_video(worker="w")
    html = page_of(world, "anonymous", run)
    video = Video.objects.get()
    assert f'src="/videos/{video.public_id}/video.mp4"' in html and 'preload="metadata"' in html
    assert re.search(r"Download \(MP4, \d+\s*bytes\)", html)
    assert "video-ask" not in html


def test_without_scripts_the_page_follows_the_video_to_its_end(world, run):
    client = world.client("newcomer")
    response = client.post(f"/evaluations/{run.public_id}/video/", {"what": "0:2"})
    video = Video.objects.get()
    assert (response.status_code, response["Location"]) == (302, video.get_absolute_url())
    path = response["Location"].partition("#")[0]
    html = client.get(path).content.decode()
    assert "In queue: next." in html and 'http-equiv="refresh"' in html
    claim = VIDEOS.claim(worker="w", now=timezone.now())
    Video.objects.update(progress=40)
    html = client.get(path).content.decode()
    assert "Rendering" in html and 'value="40"' in html and 'http-equiv="refresh"' in html
    Video.objects.filter(pk=claim.pk).update(state="waiting", lease=None, leased_until=None, started_at=None)
    run_next_video(worker="w")
    html = client.get(path).content.decode()
    assert "<video" in html and 'http-equiv="refresh"' not in html


def test_with_scripts_the_card_follows_the_video(world, run):
    card = ask(world, run, **HTMX).content.decode()
    assert re.match(r'<section class="card"\s+id="video" data-say="Video: waiting.">', card)
    client = world.client("newcomer")
    address = re.search(r'hx-get="(/videos/\w+/live/\?seen=[^"]+)"', card)[1].replace("&amp;", "&")
    assert client.get(address).status_code == 204
    claim = VIDEOS.claim(worker="w", now=timezone.now())
    Video.objects.update(progress=7)
    part = client.get(address)
    assert "7 %" in part.content.decode() and "no-store" in part["Cache-Control"]
    Video.objects.filter(pk=claim.pk).update(state="waiting", lease=None, leased_until=None, started_at=None)
    run_next_video(worker="w")
    done = client.get(address)
    assert (done["HX-Retarget"], done["HX-Reswap"]) == ("#video", "outerHTML")
    assert "<video" in done.content.decode()


def test_only_the_requester_and_admins_see_the_stop_button(world, run):
    ask(world, run)
    video = Video.objects.get()
    for viewer, sees in (("newcomer", True), ("admin", True), ("bob", False), ("alice", False), ("anonymous", False)):
        assert (f'action="/videos/{video.public_id}/stop/"' in page_of(world, viewer, run)) == sees, viewer
    assert world.client("bob").post(f"/videos/{video.public_id}/stop/").status_code == 404
    assert world.client("anonymous").post(f"/videos/{video.public_id}/stop/").status_code == 302
    video.refresh_from_db()
    assert video.is_under_way
    assert world.client("newcomer").post(f"/videos/{video.public_id}/stop/").status_code == 302
    html = page_of(world, "newcomer", run, f"?video={video.public_id}")
    assert 'data-code="video_stopped"' in html and "Make it again" in html


def test_a_refusal_is_shown_with_its_code(world, run, settings):
    settings.VIDEOS_AT_ONCE = 1
    ask(world, run)
    assert 'data-code="videos_at_once"' in ask(world, run, what="0:2", **HTMX).content.decode()
    followed = world.client("newcomer").post(f"/evaluations/{run.public_id}/video/", {"what": "0:99"}, follow=True)
    assert 'data-code="video_lap_unknown"' in followed.content.decode()
    for nonsense in ("", ":", "x:y", "²:1", "0:²", "9999999:1", "0:" + "9" * 999):
        assert ask(world, run, viewer="alice", what=nonsense, **HTMX).status_code == 200


def test_a_failed_video_may_be_requested_again(world, run):
    from paddock.errors import UserFault

    ask(world, run)
    claim = VIDEOS.claim(worker="w", now=timezone.now())
    fault = UserFault("video_no_steps")
    VIDEOS.fail(pk=claim.pk, lease=claim.lease, fault=fault, now=timezone.now())
    html = page_of(world, "newcomer", run, f"?video={claim.public_id}")
    assert 'data-code="video_no_steps"' in html and "Make it again" in html
    assert Video.objects.get(state="failed") == claim
    ask(world, run)
    assert Video.objects.get().state == "waiting"


def test_a_changed_look_hides_the_old_video_and_offers_a_new_one(world, run):
    ask(world, run)
    run_next_video(worker="w")
    video = Video.objects.get()
    client = world.client("newcomer")
    address = f"/videos/{video.public_id}/video.mp4"
    assert client.get(address).status_code == 200
    type(run.model).objects.filter(pk=run.model_id).update(colour="#ff0000")
    assert client.get(address).status_code == 404
    assert client.get(f"/videos/{video.public_id}/still.jpg").status_code == 404
    html = page_of(world, "newcomer", run, f"?video={video.public_id}")
    assert "<video" not in html and "Make it again" in html


def test_a_duel_offers_laps_of_each_car_and_names_the_followed_one(world, video_wakes):
    race = a_duel_race(world.now)
    qualify(race, [world.alice, world.bob], world.now)
    from races.duels.services import draw_duels, drive_on

    draw_duels(race=race, now=race.closes_at)
    drive_on(race=race, now=race.closes_at)
    duel = driving(race)[0]
    end(duel, world.now)
    duel.evaluation.refresh_from_db()
    html = page_of(world, "newcomer", duel.evaluation)
    values = _Options(html).values
    assert {value.partition(":")[0] for value in values} == {"0", "1"}
    assert 'optgroup label="alice"' in html and 'optgroup label="bob"' in html
    ask(world, duel.evaluation, what="1:best")
    assert Video.objects.get().car == 1
    run_next_video(worker="w")
    assert re.search(
        r'id="video"[^>]*>.*?Lap 1 · <span class="name">', page_of(world, "newcomer", duel.evaluation), re.S
    )


def test_byte_ranges_are_served_as_requested(world, run):
    ask(world, run)
    run_next_video(worker="w")
    address = f"/videos/{Video.objects.get().public_id}/video.mp4"
    client = world.client("anonymous")
    whole = client.get(address)
    assert (whole.status_code, whole["Accept-Ranges"]) == (200, "bytes")
    content = whole.getvalue()
    part = client.get(address, headers={"range": "bytes=0-1"})
    assert (part.status_code, part.getvalue()) == (206, content[:2])
    assert client.get(address, headers={"range": "bytes=999999-"}).status_code == 416
    head = client.head(address)
    assert (head.status_code, head["Content-Length"], head.content) == (200, str(len(content)), b"")
    assert client.get(address, headers={"if-none-match": whole["ETag"]}).status_code == 304
    still = client.get(f"/videos/{Video.objects.get().public_id}/still.jpg")
    assert (still["Content-Type"], still.getvalue()) == ("image/jpeg", b"a still")
    assert "attachment" in client.get(f"{address}?download")["Content-Disposition"]


def test_a_lost_file_is_not_found_and_may_be_requested_again(world, run):
    ask(world, run)
    run_next_video(worker="w")
    video = Video.objects.get()
    video.file.storage.delete(video.file.name)
    assert world.client("anonymous").get(f"/videos/{video.public_id}/video.mp4").status_code == 404
    assert 'data-code="video_file_lost"' in page_of(world, "newcomer", run, f"?video={video.public_id}")


def test_a_private_run_has_private_videos(world, video_wakes):
    run = world.evaluation("other")
    ask(world, run, viewer="alice")
    run_next_video(worker="w")
    public_id = Video.objects.get().public_id
    paths = [f"/videos/{public_id}/{name}" for name in ("video.mp4", "still.jpg", "live/")]
    for viewer in ("anonymous", "newcomer", "bob", "alice", "admin"):
        for path in paths:
            expected = 200 if viewer in ("alice", "admin") else 404
            assert world.client(viewer).get(path).status_code == expected, (viewer, path)
    assert ask(world, run, viewer="bob").status_code == 404
    assert ask(world, run, viewer="anonymous").status_code == 302


def test_videos_of_other_parts_and_languages_are_linked(world, run):
    for part, language in (("1", "en"), ("2", "ko"), ("whole", "en")):
        request_video(evaluation=run, by=world.newcomer, part=part, language=language, now=timezone.now())
        run_next_video(worker="w")
    html = page_of(world, "bob", run)
    assert html.count("<video") == 1
    others = re.findall(r'href="[^"]*\?video=(\w+)#video" hreflang="(\w\w)"', html)
    assert len(others) == 2 and "(ko)" in html
    shown = page_of(world, "bob", run, f"?video={others[0][0]}")
    assert f'src="/videos/{others[0][0]}/video.mp4"' in shown


def test_disabled_videos_are_not_offered_but_old_ones_are_shown(world, run, settings):
    ask(world, run)
    run_next_video(worker="w")
    settings.VIDEOS = False
    html = page_of(world, "newcomer", run)
    assert "<video" in html and "video-ask" not in html
    assert 'id="video"' not in page_of(world, "alice", world.evaluation("other"))


def test_names_are_escaped_on_the_video_card(world, video_wakes):
    from tests.factories import a_race

    run = a_driven_run(a_race(world.now, name="<b>Race</b>"), world.alice, world.now)
    ask(world, run)
    assert "<b>Race" not in page_of(world, "newcomer", run)


WRONG = {"what": "0:2", "from": "3,5", "to": "2", "camera": "onboard", "format": "webp"}


class _Fields(HTMLParser):
    """The fields of the form with their values, whether it is open, and the field that is wrong."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.values: dict[str, str] = {}
        self.open, self.wrong, self.sentence, self._select, self._in = False, "", "", "", False
        self.feed(html.partition('id="video"')[2])

    def handle_starttag(self, tag, attrs):
        known = dict(attrs)
        if tag == "details" and known.get("class") == "video-more":
            self.open = "open" in known
        if "aria-invalid" in known:
            self.wrong = known["name"]
        self._select = known.get("name", "") if tag == "select" else self._select
        self._in = known.get("id") == "video-fault" or (self._in and tag != "details")
        if tag == "option" and "selected" in known:
            self.values[self._select] = known["value"]
        if tag == "input" and known.get("name") in ("from", "to"):
            self.values[known["name"]] = known.get("value", "")

    def handle_data(self, data):
        self.sentence += data.strip() if self._in else ""
        self._in = False


def test_a_refused_clip_keeps_what_was_typed_and_says_why_at_its_field(world, run):
    client, address = world.client("newcomer"), f"/evaluations/{run.public_id}/video/"
    answers = client.post(address, WRONG, **HTMX), client.post(address, WRONG, follow=True)
    for answer in answers:
        form = _Fields(answer.content.decode())
        assert form.values == WRONG and form.open and form.wrong == "to"
        assert form.sentence == "The end of the clip must come after its beginning. Choose a later end."
    for changed, wrong in (({"from": "x"}, "from"), ({"to": "99999"}, "to"), ({"from": "0", "to": "21"}, "format")):
        form = _Fields(client.post(address, WRONG | changed, **HTMX).content.decode())
        assert form.wrong == wrong and form.values == WRONG | changed and form.sentence
    assert not Video.objects.exists()


def test_a_refusal_without_a_field_keeps_what_was_typed_and_stands_above(world, run, settings):
    settings.VIDEOS_AT_ONCE = 1
    ask(world, run)
    fine = WRONG | {"to": "5"}
    html = world.client("newcomer").post(f"/evaluations/{run.public_id}/video/", fine, **HTMX).content.decode()
    form = _Fields(html)
    assert form.values == fine and form.open and not form.wrong and 'data-code="videos_at_once"' in html


def test_a_link_to_a_clip_opens_the_form_filled_in(world, run):
    fine = WRONG | {"to": "5"}
    query = "&".join(f"{name}={value}" for name, value in fine.items())
    form = _Fields(page_of(world, "newcomer", run, f"?{query}"))
    assert form.values == fine and form.open and not form.wrong and not form.sentence
    plain = _Fields(page_of(world, "newcomer", run))
    assert plain.values == {"what": "0:1", "from": "", "to": ""} and not plain.open
    for nonsense in ("?what=9:9", "?what=&camera=drone", "?what=0:2&from=1e999&to=nan"):
        assert 'id="video"' in page_of(world, "newcomer", run, nonsense)


def test_only_readers_who_may_make_clips_are_led_to_the_form(world, run, settings):
    viewers = (f"/evaluations/{run.public_id}/", f"/evaluations/{run.public_id}/replay/")
    led = f"&quot;clip&quot;: &quot;/evaluations/{run.public_id}/&quot;"
    for address in viewers:
        assert led in world.client("newcomer").get(address).content.decode()
        assert led not in world.client("anonymous").get(address).content.decode()
    settings.VIDEOS = False
    assert led not in world.client("newcomer").get(viewers[1]).content.decode()
