"""A world in which every form of the site is to be seen by somebody."""

from __future__ import annotations

import uuid
from collections.abc import Mapping
from datetime import timedelta
from io import BytesIO

from allauth.account.forms import default_token_generator
from allauth.account.models import EmailAddress, EmailConfirmationHMAC
from allauth.account.utils import user_pk_to_url_str
from PIL import Image

from accounts.class_accounts.services import add_learners, make_class
from accounts.following import follow_racer
from accounts.groups.services import ask_to_join, confirm_member, make_group
from accounts.models import ClassLearner, Classroom, GroupMember, Racer, RacerGroup
from accounts.teams.services import found_team, invite_to_team, join_by_link
from accounts.tokens.services import create_token
from evaluation.garage.services import share_model
from evaluation.running.queue.services import stop_evaluation
from league.invitations.services import invite_by_mail, link_token, stop_token
from league.models import MailInvitation, Round, Stage
from league.notices import kinds as notice_kinds
from league.notices.services import stopping_token
from league.stewarding.official_results import close_due_rounds, close_round
from league.webhooks.services import add_webhook
from races.entries.services.entries import enter_race, remove_entry, withdraw
from races.models import Guest, Race, Recheck
from races.test_runs.services import drive_own
from races.timing.services import carry_over, make_sensor
from tests.courses.assignments import an_assignment, finish_all, hand_in
from tests.drawn_runs import a_driven_run
from tests.duels import a_duel_race, qualify
from tests.evaluation.reports import a_report, drive, off_the_road
from tests.factories import a_model, a_race, a_racer, laps
from tests.happened import tell_what_happened
from tests.league.seasons import a_season, board, racers
from tests.pages.conftest import World
from tests.races.timing import a_session, a_timed_race
from tests.training.jobs import a_sweep_row, a_training
from training.lessons.catalogue import LESSONS
from training.models import JobState, TrainingJob
from training.vehicles.services import save_vehicle
from videos.services import request_video, run_next_video

PASSWORD = "a long enough passphrase"


def a_picture() -> bytes:
    """A PNG."""
    out = BytesIO()
    Image.new("RGB", (64, 48), (10, 120, 60)).save(out, "PNG")
    return out.getvalue()


def assign(world: World, classroom: Classroom, lab: RacerGroup) -> dict[str, str]:
    """An assignment of alice's class with an attempt that is marked, a draft, and one that alice has to hand in."""
    now, alice = world.now, world.alice
    kim = ClassLearner.objects.filter(classroom=classroom).earliest("pk").racer
    made = an_assignment(classroom.group, now, title="Three laps", shows="named")
    attempt = hand_in(made, kim, now)
    finish_all(attempt, laps(9_000, 9_100, 9_200), now)
    draft = an_assignment(classroom.group, now, publish=False, title="Draft")
    GroupMember.objects.create(group=lab, racer=alice, asked_at=now, confirmed_at=now, confirmed_by=world.admin)
    task = an_assignment(lab, now, title="Lab task")
    words = {"assignment": made, "attempt": attempt, "draft": draft, "task": task}
    return {name: row.public_id for name, row in words.items()}


class Cast:
    """Who looks at the world: a guest, racers, an organiser (alice) and an admin; and the words that stand for its
    rows in addresses."""

    def __init__(self, world: World) -> None:
        now = world.now
        self.racers: dict[str, Racer | None] = {
            "guest": None,
            "newcomer": world.newcomer,
            "alice": world.alice,
            "admin": world.admin,
        }
        alice, bob, newcomer = world.alice, world.bob, world.newcomer
        for racer in (alice, bob, world.admin):
            racer.set_password(PASSWORD)
            racer.save()
        EmailAddress.objects.create(user=alice, email=alice.email, primary=True, verified=True)
        EmailAddress.objects.create(user=alice, email="alice.again@example.org")
        EmailAddress.objects.create(user=bob, email=bob.email, primary=True, verified=True)

        left = a_race(now, slug="left-race", name="Left race")
        withdraw(entry=enter_race(race=left, racer=newcomer, now=now), now=now)
        enter_race(race=world.race, racer=newcomer, now=now)
        gone = a_racer("gone")
        fresh = EmailAddress.objects.create(user=gone, email=gone.email, primary=True)
        remove_entry(entry=enter_race(race=world.race, racer=gone, now=now), by=alice, now=now, reason="Rude")
        a_race(now, slug="later-race", name="Later race", opens_at=now + timedelta(days=2), organiser=alice)
        a_race(now, slug="rain-race", name="Rain race", organiser=alice)
        duels = a_duel_race(now - timedelta(days=1), slug="duel-race", name="Duel race", organiser=alice)
        qualify(duels, [a_racer("one"), a_racer("two")], duels.opens_at)
        a_model(newcomer, name="Spark")
        spare, shared, theirs = (
            a_model(alice, name="Spare"),
            a_model(alice, name="Thunder"),
            a_model(bob, name="Theirs"),
        )
        share_model(model=shared, now=now)
        share_model(model=theirs, now=now)
        driven = a_driven_run(world.race, bob, now)
        chased = a_driven_run(a_race(now, slug="chase-race", name="Chase race"), bob, now, lap_ms=1_100)
        Recheck.objects.create(day=now, evaluation=driven, number=0, state="finished", same=False, ended_at=now)
        ready = request_video(evaluation=driven, by=bob, car=0, part="best", language="en", now=now).video
        run_next_video(worker="test")
        waits = request_video(evaluation=driven, by=alice, car=0, part="whole", language="en", now=now).video

        running = a_training(alice, world.track, now, name="Underway")
        ended = a_training(newcomer, world.track, now, name="Ended")
        values = {"state": JobState.FINISHED, "ended_because": "time", "ended_at": now, "steps_done": 2000}
        values |= {"best_model": spare, "last_model": spare, "owner": alice}
        TrainingJob.objects.filter(pk=ended.pk).update(**values)
        sweep = a_sweep_row(alice, world.track, now, name="Rates")
        swept = a_sweep_row(alice, world.track, now, name="Swept", state="stopped", ended_at=now)
        vehicle = save_vehicle(owner=alice, vehicle=None, name="Buggy", sensors=["FRONT_FACING_CAMERA"])

        create_token(racer=world.admin, now=now)
        add_webhook(owner=alice, url="https://example.org/hook")
        own = [drive_own(owner=alice, model=spare, track=world.track, now=now) for _ in range(3)]
        for one in own[:2]:
            stop_evaluation(evaluation=one.evaluation, now=now)
        alice.quotas.create(name="reports_at_once", limit=50)
        done, again, waiting, listed = (a_report(alice, now, model=spare, tracks=[world.track]) for _ in range(4))
        for one in (done, again):
            drive(one, now, off_the_road(39))
        self._season(world)
        comets = found_team(by=alice, name="Comets", now=now)
        for racer in (a_racer("comet-1"), a_racer("comet-2")):
            join_by_link(code=comets.code, racer=racer, now=now)
        for alias in ("newcomer", "gone"):
            invite_to_team(team=comets, alias=alias, by=alice, now=now)
        for captain, name in (("ace", "Aces"), ("rocket", "Rockets"), ("rebel", "Rebels")):
            team = found_team(by=a_racer(captain), name=name, now=now)
            invite_to_team(team=team, alias="newcomer", by=team.captain, now=now)
        self.team_code = comets.code
        follow_racer(follower=alice, racer=Racer.objects.get(alias="slowpoke"), now=now)
        then, later = now - timedelta(days=2), world.upcoming
        type(later).objects.filter(pk=later.pk).update(organiser=alice)
        later.refresh_from_db()
        ask = {"by": alice, "language": "en"}
        invite_by_mail(race=world.secret, addresses=["old@example.org"], now=then, **ask)
        invite_by_mail(race=later, addresses=["c@example.org"], now=now, **ask)
        MailInvitation.objects.update(state="sent", ended_at=then)
        make_group(by=world.admin, name="Stewards", now=now)  # nobody deletes it: the admin site has a first row
        self.group = make_group(by=alice, name="Club", now=now)
        for racer in (bob, gone, a_racer("asking")):
            asked = ask_to_join(code=self.group.code, racer=racer, now=now)
            if racer == bob:
                confirm_member(member=asked, by=alice, now=now)
        seventh = make_class(teacher=alice, name="7c", plan=["agent"], now=now)
        add_learners(classroom=seventh, by=alice, names=["Kim Minji", "Ann Lee"], now=now)
        assigned = assign(world, seventh, make_group(by=world.admin, name="Lab", now=now))
        real, mia = a_timed_race(now, alice, bob, beside=world.race)
        self.real, self.mia = real, mia
        self.lap = real.timed_sessions.get(entry__racer=bob).laps.get(number=1)
        id = uuid.uuid4()
        carry_over(race=real, by=alice, sent=a_session(now, 14_000, guest=(id, "Tom Guest")), now=now)
        self.tom = Guest.objects.get(pk=id)
        make_sensor(race=real, name="Old gate", by=alice, now=now)
        tell_what_happened(now=now)
        key = f"{user_pk_to_url_str(bob)}-{default_token_generator.make_token(bob)}"
        names = ("finished", "other", "queued", "running", "failed", "ours")
        self.words = {name: getattr(world, name).evaluation.public_id for name in names} | {
            "invitation": world.secret.invitation,
            "driven": driven.public_id,
            "chased": chased.public_id,
            "timed_lap": self.lap.pk,
            "claim": mia.claim,
            "invited": link_token(MailInvitation.objects.get(email="c@example.org")),
            "invited_stop": stop_token("c@example.org"),
            "team_code": self.team_code,
            "group_code": self.group.code,
            "ready": ready.public_id,
            "waits": waits.public_id,
            "model": world.model.public_id,
            "spare": spare.public_id,
            "shared": shared.public_id,
            "theirs": theirs.public_id,
            "job": running.public_id,
            "ended": ended.public_id,
            "sweep": sweep.public_id,
            "swept": swept.public_id,
            "vehicle": vehicle.public_id,
            "own": own[0].evaluation.public_id,
            "report": done.public_id,
            "report_waits": waiting.public_id,
            "report_listed": listed.public_id,
            **assigned,
            "stop": stopping_token(alice.pk, notice_kinds.RESULT),
            "confirm": EmailConfirmationHMAC(fresh).key,
            "reset": key,
        }

    def _season(self, world: World) -> None:
        """A season whose first race is official, whose second is over, and whose third is open."""
        first = world.now - timedelta(days=41)
        season = a_season()
        for number, name in enumerate(("Official", "Over", "Open"), 1):
            opens = first + timedelta(days=20 * (number - 1))
            round_ = Round.objects.create(
                season=season,
                number=number,
                stage=Stage.OPEN,
                name=name,
                race=a_race(
                    world.now,
                    slug=f"round-{number}",
                    name=f"Round {name}",
                    kind="league",
                    division="open",
                    opens_at=opens,
                    closes_at=opens + timedelta(days=19),
                ),
            )
            board(round_.race, [world.bob, *racers(4)])
            if name == "Official":
                close_round(round=round_, now=world.now)
        close_due_rounds(now=world.now)  # as the sweep does

    def examples(self, viewer: str) -> Mapping[str, list[dict[str, str]]]:
        """For the beginning of a route: what its parameters may be, as far as it concerns this viewer."""
        said, is_guest = self.words, viewer == "guest"
        races = Race.objects.values_list("slug", flat=True)
        runs = [{"public_id": said[name]} for name in ("finished", "queued", "running", "failed", "driven")]
        return {
            "racers/": [{"alias": "alice"}, {"alias": "house-steady"}],
            "seasons/<slug:slug>/": [{"slug": "2027"}],
            "seasons/<slug:slug>/racers/<": [{"slug": "2027", "alias": "bob"}],
            "notices/stop/": [{"token": said["stop"]}],
            "notices/<int:pk>/": [],
            "settings/": [],
            "train/<str:public_id>/": [{"public_id": said["job"]}, {"public_id": said["ended"]}],
            "train/sweeps/<": [{"public_id": said["sweep"]}, {"public_id": said["swept"]}],
            "vehicles/<str:public_id>/": [{"public_id": said["vehicle"]}],
            "cups/": [],  # a page without a form; the form of the list has a case
            "classes/<": [{"slug": "7c"}],
            "assignments/copy/<": [{"slug": "7c"}],
            "assignments/of/<": [],
            "assignments/<": [{"public_id": said[name]} for name in ("assignment", "draft", "task")],
            "assignments/<str:public_id>/parts/<int:number>/": [{"public_id": said["draft"], "number": "1"}],
            "attempts/<": [{"public_id": said["attempt"]}],
            "class/<": [{"code": "ABCDEFGHJKMN"}],
            "teams/<": [{"slug": "comets"}],
            "teams/join/<": [{"code": said["team_code"]}],
            "laps/<": [{"claim": self.mia.claim}],
            "races/<slug:slug>/timing/": [{"slug": "real-race"}],
            "races/<slug:slug>/timing/timekeepers/<": [],
            "races/<slug:slug>/timing/sensors/<": [],
            "races/<slug:slug>/timing/guests/<": [],
            "races/<slug:slug>/laps/": [{"slug": "real-race"}],
            "races/<slug:slug>/laps/<": [{"slug": "real-race", "id": str(self.lap.pk)}],
            "races/<slug:slug>/car/": [],
            "races/<slug:slug>/live/overlay/<": [],  # which a broadcast lays over its picture: nothing to send
            "groups/<": [{"slug": "club"}],
            "groups/join/<": [{"code": said["group_code"]}],
            "watch/<": [],  # leads to a page of the live event
            "races/invited/<": [{"token": said["invited"]}],
            "races/<slug:slug>/invited/": [{"slug": "secret-race"}],
            "invitations/stop/<": [{"token": said["invited_stop"]}],
            "guides/": [{"slug": "tracks"}],
            "learn/": [{"slug": lesson.slug} for lesson in LESSONS[:1]],
            "join/": [],  # leads to the form for signing up
            "programs/": [],  # tests/accounts/test_programs.py sends its forms
            "audit/": [],  # a file
            "embed/": [{"kind": "race", "shared": "open-race"}, {"kind": "run", "shared": said["driven"]}],
            "workers/": [{"name": "evaluations"}],
            "races/join/": [{"token": said["invitation"]}],
            "races/<slug:slug>/$": [{"slug": slug} for slug in races],
            "races/<slug:slug>/": [{"slug": "open-race"}],
            "races/<slug:slug>/edit/": [{"slug": "open-race"}, {"slug": "secret-race"}],
            "races/<slug:slug>/duels/": [{"slug": "duel-race"}],
            "races/<slug:slug>/racers/<": [{"slug": "open-race", "alias": "bob"}],
            "evaluations/<str:public_id>/$": runs,
            "evaluations/<str:public_id>/": [*runs[1:2], {"public_id": said["own"]}],
            "evaluations/<str:public_id>/compare/": [],  # leads to the next
            "evaluations/<str:public_id>/replay/": [{"public_id": said["driven"]}],
            "reports/<str:public_id>/live/": [],  # a part of the page, which has the same forms
            "reports/<str:public_id>/": [{"public_id": said[name]} for name in ("report", "report_waits")],
            "videos/<str:public_id>/": [{"public_id": said["waits"]}],
            "models/<str:public_id>/": [{"public_id": said[name]} for name in ("model", "spare", "shared", "theirs")],
            "tracks/<slug:slug>/": [{"slug": "oval"}],
            "accounts/2fa/": [],  # tests/pages/test_second_factor_browser.py
            "accounts/^confirm-email/": [{"key": said["confirm"]}] if is_guest else [],
            "accounts/^password/reset/key/": [dict(zip(("uidb36", "key"), said["reset"].split("-", 1), strict=True))]
            if is_guest
            else [],
        }
