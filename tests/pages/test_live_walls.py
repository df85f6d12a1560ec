"""No byte of the future: while a sealed run is played, every address of the site is fetched as everybody, and nothing
of what is still to come is in any answer."""

from __future__ import annotations

import gzip
import io
import itertools
import re
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import timedelta

import pytest
from django.contrib import admin
from django.test import Client
from django.urls import URLPattern, URLResolver, get_resolver, reverse
from django.urls.exceptions import NoReverseMatch
from django.utils import timezone

from accounts.models import Racer
from core.events import Event
from evaluation.models import Evaluation, Result
from evaluation.running.queue.jobs import finish_evaluation
from races.entries.services.entries import enter_race
from races.live.services import (
    begin_live,
    choose_model,
    command_now,
    end_live,
    launch,
    plan_live,
    prepare_ahead,
    tick_live,
)
from races.models import LiveEvent, LiveSlot, Visibility
from tests.evaluation.stubs import HEADER
from tests.factories import a_model, lap, outcome, start
from tests.pages.conftest import World, make_world
from tests.soak import only

pytestmark = [pytest.mark.django_db, pytest.mark.slow]
PLAYED_S = 6
FIRST_MS, SECOND_MS = 13_457, 12_861  # laps that nobody else drives; both end after what is played
STEP_MS = 1000 / 15
VIEWERS = ("guest", "stranger", "member", "racer", "organiser", "staff")
Needles = dict[str, re.Pattern[bytes]]


@dataclass
class Show:
    """A run that has been on track for some seconds, and the next one, computed and waiting."""

    world: World
    event: LiveEvent
    playing: LiveSlot
    coming: LiveSlot
    viewers: dict[str, Racer | None]

    def needles(self) -> Needles:
        """What must not be in any answer, by what it is."""
        found: dict[str, str] = {}
        times: dict[str, str] = {}
        for slot, name in ((self.playing, "playing"), (self.coming, "coming")):
            run = Evaluation.with_sealed.get(pk=slot.evaluation_id)
            result = Result.with_sealed.get(evaluation=run)
            found |= {f"id of {name}": run.public_id, f"hash of {name}": result.trace_sha256}
            for time in (FIRST_MS, SECOND_MS, FIRST_MS + SECOND_MS):
                written = f"{time // 60_000}:{time // 1000 % 60:02}.{time % 1000:03}"
                times |= {f"{time} ms": str(time), f"{time} read": written[2:], f"{time} s": f"{time / 1000:.3f}"}
            for second in (PLAYED_S + 4, 20):
                x, _y = place(second * 15)
                found |= {f"place at {second} s": f"{x:.5f}", f"pose at {second} s": str(round(x, 4))}
        assert self.playing.ends_at is not None
        found["end"] = self.playing.ends_at.isoformat()[:19]
        return sought(found, times)


def sought(texts: dict[str, str], times: dict[str, str]) -> Needles:
    """Patterns of texts as they are, and of times that stand alone: the microseconds of another moment, or a hash,
    may by chance hold the same digits (``2026-11-26T21:07:44.134571+00:00``)."""
    found = {what: re.compile(re.escape(text.encode())) for what, text in texts.items()}
    alone = rb"(?<![0-9a-f])%s(?![0-9a-f])"
    return found | {what: re.compile(alone % re.escape(text.encode())) for what, text in times.items()}


def place(step: int) -> tuple[float, float]:
    """Where the car is at a step: no two alike."""
    return 3.0 + step * 0.00731, 1.0 + step * 0.00137


def a_trace() -> bytes:
    steps = round((FIRST_MS + SECOND_MS) / STEP_MS)
    rows = []
    for step in range(steps):
        x, y = place(step)
        where = f"{int(step * STEP_MS >= FIRST_MS)},{step},{x:.5f},{y:.5f},0.0,0.0,1.5,1,0.0,False,True,1.0,1,20.0"
        rows.append(f"{where},{step / 15},in_progress,0.0,0,0.0")
    return "\n".join([HEADER, *rows, ""]).encode()


def compute(slot: LiveSlot, salt: int) -> None:
    run = Evaluation.with_sealed.get(pk=slot.evaluation_id)
    start(run, timezone.now())
    driven = [lap(1, FIRST_MS), {**lap(2, SECOND_MS), "start_ms": FIRST_MS}]
    told = replace(outcome(driven), trace_csv=a_trace(), trace_sha256=f"{salt:064x}".replace("0", "e"))
    assert finish_evaluation(pk=run.pk, lease=run.lease, outcome=told, now=timezone.now())


@pytest.fixture
def show(monkeypatch: pytest.MonkeyPatch, wakes, video_wakes) -> Show:
    world, now = make_world(), timezone.now()
    monkeypatch.setattr(timezone, "now", lambda: now)  # the walk takes longer than the run
    race, bob = world.race, world.bob
    event = plan_live(
        race=race, by=world.alice, now=now, starts_at=now + timedelta(hours=1), rounds=1, speed_control=True
    )
    carl = Racer.objects.create_user("carl", "carl@example.org", None)
    dora = Racer.objects.create_user("dora", "dora@example.org", None)
    for racer in (bob, carl, dora):
        enter_race(race=race, racer=racer, now=now)
        choose_model(event=event, racer=racer, model=a_model(racer), now=now)
    LiveEvent.objects.filter(pk=event.pk).update(order="as_entered")
    begin_live(event=event, by=world.alice, seen=None, now=now)
    slots = {slot.racer.entry.racer.alias: slot for slot in LiveSlot.objects.filter(event=event)}
    LiveSlot.objects.filter(event=event).exclude(pk__in=[slots["bob"].pk, slots["carl"].pk]).update(state="held")
    prepare_ahead(event=event, now=now)
    for salt, name in enumerate(("bob", "carl"), 1):
        slots[name].refresh_from_db()
        compute(slots[name], salt)
    launch(event=event, by=world.alice, seen=None, now=now - timedelta(seconds=10 + PLAYED_S), slot=slots["bob"])
    mine = slots["bob"].racer
    command_now(event=event, racer=mine, by=bob, mode="cap", value=2.0, now=now)
    for slot in slots.values():
        slot.refresh_from_db()
    viewers = {
        "guest": None,
        "stranger": world.newcomer,
        "member": dora,
        "racer": bob,
        "organiser": world.alice,
        "staff": world.admin,
    }
    return Show(world, event, slots["bob"], slots["carl"], viewers)


def routes(patterns, before: str = "", space: str = "") -> Iterator[tuple[str, list[str]]]:
    """Every named route with the names of its parameters."""
    for one in patterns:
        if isinstance(one, URLResolver):
            inner = f"{space}{one.namespace}:" if one.namespace else space
            yield from routes(one.url_patterns, before + str(one.pattern), inner)
        elif isinstance(one, URLPattern) and one.name is not None:
            yield space + one.name, list(one.pattern.converters) or list(one.pattern.regex.groupindex)


def everything(show: Show) -> list[str]:
    """All addresses of the site, with what their parameters may be in the live event and around it."""
    runs = [Evaluation.with_sealed.get(pk=slot.evaluation_id) for slot in (show.playing, show.coming)]
    said = {
        "slug": ["open-race"],
        "alias": ["bob"],
        "public_id": [*(run.public_id for run in runs), *(run.model.public_id for run in runs)],
        "pk": [str(runs[0].pk)],
        "number": ["1"],
        "form": ["openvino"],
        "name": ["evaluations", "messages"],
        "piece": ["tower", "clock", "lower-third", "next", "bracket"],
    }
    found = ["/openapi.json"]
    for name, parameters in routes(get_resolver().url_patterns):
        if name.startswith("admin:"):
            continue
        values = [said.get(parameter, ["1"]) for parameter in parameters]
        if "track" in name:
            values = [
                ["oval"] if parameter == "slug" else value for parameter, value in zip(parameters, values, strict=True)
            ]
        for chosen in itertools.product(*values):
            try:
                found.append(reverse(name, kwargs=dict(zip(parameters, chosen, strict=True))))
            except NoReverseMatch:
                continue
    slot, coming = show.playing.pk, show.coming.pk
    for address in (reverse("live_poses", args=["open-race"]), reverse("api-live-poses", args=["open-race"])):
        found += [f"{address}?slot={number}&after={after}" for number in (slot, coming) for after in (-1, 5, 20, 9999)]
    frames = reverse("live_frames", args=["open-race"])
    found += [f"{frames}?slot={number}&n={n}" for number in (slot, coming) for n in (0, 2 * PLAYED_S, 9999)]
    for model in admin.site._registry:
        begin = f"admin:{model._meta.app_label}_{model._meta.model_name}"
        found.append(reverse(f"{begin}_changelist"))
        last = model._base_manager.order_by("-pk").first()
        for row in (last,) if last is not None else ():
            found += [reverse(f"{begin}_{page}", args=[row.pk]) for page in ("change", "delete", "history")]
    for run in runs:
        found += [reverse("admin:evaluation_evaluation_change", args=[run.pk])]
        results = Result.with_sealed.filter(evaluation=run)  # a car that failed has none
        found += [reverse("admin:evaluation_result_change", args=[result.pk]) for result in results]
        found += [f"{reverse('own_runs')}?run={run.public_id}", f"/races/open-race/live/?seen={run.public_id}x"]
    return sorted(set(found))


def body(answer) -> bytes:
    """All bytes that left the server, unpacked."""
    if getattr(answer, "streaming", False):
        if answer.is_async:
            return b""
        content = b"".join(answer.streaming_content)
    else:
        content = answer.content
    if content[:2] == b"\x1f\x8b":
        content = gzip.decompress(content)
    if content[:2] == b"PK":
        with zipfile.ZipFile(io.BytesIO(content)) as packed:
            content += b"".join(packed.read(name) for name in packed.namelist())
    return content + repr(sorted(answer.headers.items())).encode()


def fetched(show: Show, viewer: str, under: str = "/") -> Iterator[tuple[str, int, bytes]]:
    """Every answer to this viewer of the addresses that hold ``under``."""
    client = Client(raise_request_exception=False)
    racer = show.viewers[viewer]
    if racer is not None:
        client.force_login(racer, backend="django.contrib.auth.backends.ModelBackend")
    for address in everything(show):
        if re.search(r"logout|/stream/", address) or under not in address:
            continue
        if address.startswith("/admin/") and viewer != "staff":  # closed to all others: tests/access/test_access.py
            continue
        answer = client.get(address)
        # what a page that there is not has been asked for is said back on the next one
        client.cookies.pop("messages", None)
        yield address, answer.status_code, body(answer).replace(address.encode(), b"")


def nothing_leaks(show: Show, viewer: str) -> None:
    """What is sought stands in no answer to this viewer."""
    needles, leaks, shown = show.needles(), [], 0
    for address, status, content in fetched(show, viewer):
        shown += status == 200
        # an address that was asked for may be said back
        leaks += [f"{what} in {address} ({status})" for what, needle in needles.items() if needle.search(content)]
    leaks = [leak for leak in leaks if not leak.startswith("id of") or "(200)" in leak]
    assert not leaks, "\n".join(leaks)
    assert shown > 40, "the walk has seen hardly anything"


@pytest.mark.slow
@pytest.mark.parametrize("viewer", only(("guest", "racer"), VIEWERS))
def test_nothing_of_what_is_to_come_leaves_the_server(show: Show, viewer: str):
    nothing_leaks(show, viewer)


def test_the_digits_of_another_moment_are_no_leak(show: Show):
    """The microseconds of an upload are in the garage and its list of the API, and nowhere else."""
    bob = show.viewers["racer"]
    model = bob.models.earliest("created_at")
    type(model).objects.filter(pk=model.pk).update(created_at=model.created_at.replace(microsecond=134_571))
    client = Client()
    client.force_login(bob, backend="django.contrib.auth.backends.ModelBackend")
    for address in ("/models/", "/api/v1/models/"):
        content = body(client.get(address))
        assert str(FIRST_MS).encode() in content
        assert not any(needle.search(content) for needle in show.needles().values()), address


def test_no_event_tells_of_a_sealed_run(show: Show):
    runs = Evaluation.with_sealed.filter(sealed=True).values_list("public_id", flat=True)
    assert len(runs) == 3, "two, and one of them with a command more"
    assert not Event.objects.filter(subject__in=runs).exists()


def test_what_is_sought_is_found_once_it_was_played(show: Show):
    """The walk can find it: the same needles, after the reveal."""
    needles = show.needles()
    assert show.playing.ends_at is not None
    tick_live(now=show.playing.ends_at + timedelta(seconds=3))
    found = set()
    for _address, status, content in fetched(show, "guest"):
        if status == 200:
            found |= {what for what, needle in needles.items() if needle.search(content)}
    assert {"id of playing", "hash of playing", f"{FIRST_MS} ms", f"{SECOND_MS} ms"} <= found
    assert f"pose at {PLAYED_S + 4} s" in found
    assert "id of coming" not in found
    assert "hash of coming" not in found


@pytest.mark.parametrize("viewer", only(("stranger",), ("guest", "stranger")))
@pytest.mark.parametrize("when", ["while it is played", "when it is over"])
def test_a_private_show_is_nowhere_for_strangers(show: Show, viewer: str, when: str):
    if when == "when it is over":
        assert show.playing.ends_at is not None
        over = show.playing.ends_at + timedelta(seconds=3)
        tick_live(now=over)
        end_live(event=show.event, by=show.world.alice, seen=None, now=over)
    type(show.event.race).objects.filter(pk=show.event.race_id).update(visibility=Visibility.INVITATION)
    statuses = set()
    for address, status, content in fetched(show, viewer, "/races/open-race"):
        statuses.add(status)
        assert status != 200 or b"Open race" not in content, address
    assert 404 in statuses
