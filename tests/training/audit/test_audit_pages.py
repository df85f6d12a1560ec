"""The audit from the wizard and the laboratory, and the drives that they keep."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier, Lock

import pytest
from django.core.cache import cache

from tests.factories import a_track
from training.rewards.audit import drives as recorded
from training.rewards.audit import services
from training.rewards.audit.services import drives_on
from training.rewards.check_slots import one_check

from .driven import driven
from .shapes import SHAPES

pytestmark = pytest.mark.django_db
CONSTANT = SHAPES["a constant"]


@pytest.fixture(autouse=True)
def driven_once(monkeypatch):
    monkeypatch.setattr(recorded, "eight_drives", driven)


@pytest.fixture
def page(alice, client):
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    return client


def test_a_track_is_driven_once_and_then_comes_from_the_cache_unchanged(monkeypatch):
    track = a_track()
    first = drives_on(track, "cw", "time_trial")
    monkeypatch.setattr(recorded, "eight_drives", lambda *_: pytest.fail("driven again"))
    assert drives_on(track, "cw", "time_trial") == first


class AllWait:
    """A lock that is taken once this many threads want it."""

    def __init__(self, many: int) -> None:
        self.gate, self.lock = Barrier(many), Lock()

    def __enter__(self) -> None:
        self.gate.wait(60)
        self.lock.acquire()

    def __exit__(self, *_error: object) -> None:
        self.lock.release()


def test_those_who_ask_at_once_have_a_track_driven_once(monkeypatch):
    track, asked = a_track(), []
    drives = driven(track.geometry, "ccw", "time_trial")
    monkeypatch.setattr(recorded, "eight_drives", lambda *place: asked.append(place) or drives)
    monkeypatch.setattr(services, "_driving", AllWait(4))
    with ThreadPoolExecutor(4) as threads:
        found = [*threads.map(lambda _number: drives_on(track, "ccw", "time_trial"), range(4))]
    assert len(asked) == 1 and found == [[*drives]] * 4


def test_tracks_directions_and_objects_have_drives_of_their_own():
    track = a_track()
    plain = drives_on(track, "ccw", "time_trial")
    assert drives_on(track, "cw", "time_trial") != plain
    assert drives_on(track, "ccw", "head_to_head") != plain
    assert drives_on(track, "ccw", "head_to_head") == drives_on(track, "ccw", "object_avoidance")


def test_the_editor_gets_a_table_a_chart_and_sentences(page):
    sent = {"reward_code": CONSTANT, "track": a_track().slug, "race_type": "time_trial"}
    html = page.post("/train/audit/", sent).json()["html"]
    assert html.count('<th scope="row">') == 8
    assert html.count('class="audit-drive') == 8
    assert '<li class="bad">Almost standing still is worth' in html


def test_the_editor_has_it_in_korean(page):
    sent = {"reward_code": CONSTANT, "track": a_track().slug}
    html = page.post("/train/audit/", sent, headers={"Accept-Language": "ko"}).json()["html"]
    assert "거의 서 있을 때의 가치" in html
    assert "Almost standing" not in html


def test_the_laboratory_shows_it_without_a_script(page):
    sent = {"reward_code": SHAPES["speed alone"], "track": a_track().slug, "do": "audit"}
    html = page.post("/learn/laboratory/", sent).content.decode()
    assert '<li class="good">A fast lap is worth' in html


def test_the_wizard_shows_it_without_a_script_for_the_discount_factor_of_its_form(page):
    sent = {"reward_code": CONSTANT, "track": a_track().slug, "do": "audit"}
    near, far = (page.post("/train/new/", sent | {"discount_factor": factor}) for factor in ("0.5", "0.99"))
    assert near.status_code == far.status_code == 200
    # 1 - g / (1 - g) * (1 - g ** 900) / 900, for each step misses what would come after the last
    assert '<td class="num">0.999</td>' in near.content.decode()
    assert "Almost standing still is worth 0.89," in far.content.decode()
    assert near.content.decode().count('<ul class="errors') == 0


def test_one_check_or_audit_of_a_racer_at_a_time(alice, page):
    with one_check(alice):
        answer = page.post("/train/audit/", {"reward_code": CONSTANT, "track": a_track().slug})
    assert answer.status_code == 409
    assert answer.json()["problems"][0]["code"] == "reward_check_runs"


def test_the_editors_page_asks_for_nothing_before_the_button_is_pressed(page, monkeypatch):
    monkeypatch.setattr(cache, "get", _refusing(cache.get))
    html = page.get("/train/new/").content.decode()
    assert 'value="audit"' in html
    assert "audit-chart" not in html


def _refusing(get):
    def checked(key, *args, **kwargs):
        assert not str(key).startswith("reward-drives")
        return get(key, *args, **kwargs)

    return checked
