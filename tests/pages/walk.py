"""Every page of the site as a browser finds it: what there is to see on a site where much has happened, and where."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import timedelta
from functools import partial

from allauth.mfa.totp.internal.auth import TOTP
from django.conf import settings
from django.urls import URLPattern, get_resolver, resolve

from accounts.class_accounts.services import add_learners, make_class
from accounts.following import follow_racer
from accounts.groups.services import ask_to_join, confirm_member, make_group
from accounts.models import Classroom, RacerGroup, Team
from accounts.programs.services import make_program
from accounts.teams.services import found_team, invite_to_team
from evaluation.garage.services import share_model
from evaluation.models.reports import CarReport
from evaluation.running.queue.jobs import finish_evaluation
from league.invitations.services import invite_by_mail, stop_token
from league.models import Cup, CupPlace, Season, Stage
from league.notices.services import stopping_token
from league.seasons.services.demo_season import open_demo_season
from league.stewarding.official_results import close_due_rounds
from league.webhooks.services import add_webhook
from races.models import OwnEvaluation
from races.test_runs.services import drive_own
from tests.drawn_runs import a_driven_run
from tests.duels import drawn, end_all
from tests.evaluation import reports
from tests.factories import a_model, a_race, a_racer, drive, laps, outcome, start
from tests.happened import tell_what_happened
from tests.live_shows import a_live_race, a_show, begun
from tests.pages.conftest import World, make_world
from tests.pages.form_world import assign
from tests.pages.test_training import end, run
from tests.races.timing import a_timed_race
from tests.reference_laps import a_reference
from tests.training.jobs import a_sweep_row, a_training
from training.lessons.catalogue import LESSONS
from training.models import Sweep, TrainingJob
from training.vehicles.services import save_vehicle
from videos.services import request_video, run_next_video

# Addresses that show no page of their own: files, parts of pages, and what is only written to.
NO_PAGES = {
    *("audit_export", "data_download", "metrics"),
    # those for people need a platform: tests/courses/lti
    *("lti_keys", "lti_tool", "lti_launch", "lti_choose", "lti_log_in", "lti_arrival"),
    *("card", "oembed", "robots", "sitemap", "sitemaps", "track_reference_replay"),
    *("api_token_revoke", "board_atom", "board_badge", "board_csv", "board_json", "elsewhere_file", "enter"),
    *("evaluation_live", "evaluation_logs", "evaluation_metrics", "evaluation_replay", "evaluation_stop"),
    *(
        "evaluation_seen",
        "evaluation_attention",
        "evaluation_trace",
        "tracks_to_choose",
        "track_scene",
        *("evaluation_compare", "evaluation_compared"),
        "telemetry",
        "telemetry_csv",
    ),
    *("evaluation_video", "favicon", "health_live", "health_ready", "model_export"),
    *("model_package", "model_sensors", "model_share", "model_uploaded"),
    *("notice_open", "notices_read", "race_layout", "race_draw", "race_invitation_reset", "race_live"),
    *("live_watch", "live_watch_event", "live_watch_screen", "live_watch_overlay", "race_spectators_renew"),
    *(
        "own_again",
        "own_layout",
        "race_racer_restore",
        "reward_audit",
        "reward_validate",
        "season_calendar_file",
        "season_continues",
        "season_now",
        "set_language",
    ),
    *("standings_file", "submit", "theme", "training_best", "training_evaluate", "training_last", "training_live"),
    *("report_again", "report_live", "report_stop"),
    *(
        "training_logs",
        "training_metrics",
        "training_sb3",
        "training_stop",
        "sweep_stop",
        "training_trace",
        "video_file",
    ),
    "live_again",  # of an event that has ended: tests/pages/test_again_browser.py
    *("live_again_data", "live_highlights", "live_laps_csv", "live_results_csv"),
    *("race_certificate", "race_results_pdf"),
    *("car_choose", "guest_link", "race_laps_csv", "race_timing_worker", "sensor_revoke"),
    *("timekeeper_dismiss", "timekeeper_name"),
    *(
        "cup_starter",
        "live_act",
        "live_mine",
        "live_frames",
        "live_ghost",
        "live_poses",
        "live_react",
        *("live_beat", "live_panel"),
        "live_state",
        "notices_bell",
        "stream",
    ),
    "stream_clock",
    *("video_live", "video_poster", "video_stop", "webhook_remove", "webhook_secret", "webhook_test"),
    "training_first",
    "track_file",
    "group_leave",
    *("assignment_publish", "assignment_delete", "assignment_marks_csv", "attempt_refund"),
    *("group_marks", "group_assignments_delete"),
    *("follow", "team_leave", "unfollow"),
    "invited",
    *("avatar", "picture_remove", "picture_set"),
    # which lead elsewhere unless something has just happened
    *("account_confirm_login_code", "account_reauthenticate", "account_set_password"),
    "sign_up_invitation",
    # which a second factor that was just shown leads to (tests/pages/test_second_factor_browser.py)
    *("mfa_authenticate", "mfa_deactivate_totp", "mfa_download_recovery_codes", "mfa_edit_webauthn"),
    *("mfa_login_webauthn", "mfa_reauthenticate_webauthn", "mfa_remove_webauthn", "mfa_view_recovery_codes"),
}


@dataclass
class Site:
    """A world in which a season has run for a month, trainings and videos are under way, and duels were driven."""

    world: World
    season: Season
    trained: TrainingJob
    training: TrainingJob
    paths: dict[str, list[str]]  # by who looks

    def pages(self) -> Iterator[tuple[str, str]]:
        """Who looks, and where."""
        for viewer, paths in self.paths.items():
            for path in paths:
                yield viewer, path


def make_site() -> Site:
    """The site, committed, for a browser. Videos are of a few bytes (fixture ``video_wakes``)."""
    world = make_world()
    now, before = world.now, world.now - timedelta(days=45)
    season = open_demo_season(now=before)
    _a_cup(world)
    opened, under_way = season.rounds.filter(stage=Stage.OPEN).order_by("number")[:2]
    rivals = [a_racer(f"rival-{number}") for number in range(1, 9)]
    for number, racer in enumerate([world.alice, *rivals]):
        drive(opened.race, racer, laps(*[20_000 + 300 * number] * 3), before)
    close_due_rounds(now=now)
    drive(under_way.race, world.bob, laps(21_000, 20_500, 20_400), now)
    filmed = a_race(now, slug="video-race", name="Video race")
    driven, chased = a_driven_run(filmed, world.alice, now), a_driven_run(filmed, world.bob, now, lap_ms=1_100)
    request_video(evaluation=driven, by=world.alice, language="en", now=now)
    run_next_video(worker="w")
    request_video(evaluation=driven, by=world.bob, part="whole", language="en", now=now)
    robin = drawn(now - timedelta(hours=2), 4, slug="robin", name="Robin")
    end_all(robin, now)
    a_reference(world.track, 1_000, now)
    share_model(model=a_model(world.bob, name="Shared one"), now=now)
    vehicle = save_vehicle(owner=world.alice, name="My van", sensors=["STEREO_CAMERAS", "LIDAR"])
    trained = end(run(a_training(world.alice, world.track, now, name="trained")), world)
    training = run(a_training(world.alice, world.track, now, name="trains"))
    a_sweep_row(world.alice, world.track, now)
    a_sweep_row(world.alice, world.track, now, name="swept", state="stopped", ended_at=now)
    add_webhook(owner=world.alice, url="https://example.org/hook", race=world.race)
    tell_what_happened(now=now)
    follow_racer(follower=world.alice, racer=world.bob, now=now)
    make_program(by=world.admin, name="results", purpose="Results", owner="alice", now=now)
    TOTP.activate(world.bob, "GEZDGNBVGY3TQOJQGEZDGNBVGY3TQOJQ")
    owls = make_group(by=world.alice, name="Owls", now=now, description="We race at night.")
    for racer in (world.bob, world.newcomer):
        asked = ask_to_join(code=owls.code, racer=racer, now=now)
        if racer == world.bob:
            confirm_member(member=asked, by=world.alice, now=now)
    RacerGroup.objects.filter(pk=owls.pk).update(is_listed=True)
    seventh = make_class(teacher=world.alice, name="7c", plan=["agent"], now=now)
    add_learners(classroom=seventh, by=world.alice, names=["Kim Minji", "Ann Lee"], now=now)
    comets = found_team(by=world.alice, name="Comets", now=now)
    invite_to_team(team=comets, alias="bob", by=world.alice, now=now)
    type(world.race).objects.filter(pk=world.race.pk).update(team_entries="several")
    addresses = ["ann@example.org", "ben@example.org"]
    invite_by_mail(race=world.race, by=world.alice, addresses=addresses, language="en", now=now)
    token = stopping_token(world.alice.pk, "opens")
    pair = driven, chased
    return Site(world, season, trained, training, _paths(world, season, trained, training, pair, vehicle, token))


def _own(world: World) -> list[OwnEvaluation]:
    """Alice's own runs: one that is done, as in a race, and one among cars that waits."""
    ask = partial(drive_own, owner=world.alice, model=world.model, now=world.now)
    done, rivals = ask(race=world.race), [world.model, a_model(world.alice, name="Slow one")]
    run = start(done.evaluation, world.now)
    finish_evaluation(pk=run.pk, lease=run.lease, outcome=outcome(laps(20_000, 21_000, 19_000)), now=world.now)
    return [done, ask(track=world.track, race_type="head_to_head", rivals=rivals)]


def _reports(world: World) -> list[CarReport]:
    """Alice's reports: one that is done, and one that waits."""
    waiting, done = (reports.a_report(world.alice, world.now, model=world.model) for _ in range(2))
    reports.drive(done, world.now, reports.off_the_road(39, 99))
    return [done, waiting]


def _a_cup(world: World) -> None:
    """Yesterday's cup, which Alice won."""
    race = a_race(world.now, slug="a-cup", closes_at=world.now - timedelta(hours=20))
    cup = Cup.objects.create(day=(world.now - timedelta(days=1)).date(), race=race, over_at=world.now)
    CupPlace.objects.create(cup=cup, division=1, racer=world.alice, place=1, qualified=1)


def _paths(world, season, trained, training, pair, vehicle, token) -> dict[str, list[str]]:
    runs = {name: world.evaluation(name).public_id for name in ("queued", "running", "failed", "finished")}
    driven, chased = pair
    own = [run.evaluation.public_id for run in _own(world)]
    show = a_live_race(world.now, world.alice, slug="show-race", name="Show race")
    begun(a_show(world.now, world.alice, ["alice", "bob"], race=show, speed_control=True), world.alice, world.now)
    a_show(world.now, world.alice, ["bob"], race=a_live_race(world.now, world.alice, slug="plan-race", name="Planned"))
    real, mia = a_timed_race(world.now, world.alice, world.bob, beside=world.race)
    timed_lap = real.timed_sessions.get(entry__racer=world.bob).laps.get(number=1)
    done, waits = (report.public_id for report in _reports(world))
    at = f"/seasons/{season.slug}/"
    lab = make_group(by=world.admin, name="Lab", now=world.now)
    assigned = assign(world, Classroom.objects.get(), lab)
    return {
        "anonymous": [
            *("/", "/status/", "/about/", "/accounts/login/", "/accounts/signup/", "/accounts/password/reset/"),
            *("/accounts/password/reset/done/", "/accounts/password/reset/key/done/", "/accounts/inactive/"),
            *("/accounts/password/reset/key/1-none/", "/accounts/confirm-email/", "/accounts/confirm-email/none/"),
            *(f"/races/join/{world.secret.invitation}/", f"/notices/stop/{token}/", "/nothing/at/all/"),
            *("/races/open-race/", "/api/docs/", "/guides/", "/guides/?q=penalty", "/guides/tracks/"),
            *("/embed/race/open-race/", f"/embed/run/{driven.public_id}/", "/tracks/oval/reference/"),
        ],
        "alice": [
            *("/", "/races/", "/races/?show=upcoming", "/races/?show=closed", "/races/?show=mine", "/races/new/"),
            *("/races/open-race/", "/races/open-race/rules/", "/races/open-race/runs/", "/races/open-race/edit/"),
            *("/races/real-race/", "/races/real-race/laps/", "/races/real-race/rules/", "/races/real-race/edit/"),
            *("/races/real-race/timing/", "/races/real-race/timing/set-up/", f"/laps/{mia.claim}/"),
            f"/races/real-race/laps/{timed_lap.pk}/correct/",
            *("/races/show-race/event/", "/races/show-race/event/console/", "/races/show-race/event/speed/"),
            *("/races/show-race/live/screen/", "/races/show-race/live/overlay/tower/"),
            *("/races/show-race/live/commentary/", "/races/show-race/live/phone/"),
            *("/races/plan-race/event/", "/races/plan-race/event/console/", "/races/plan-race/event/plan/"),
            *("/races/open-race/racers/", "/races/open-race/racers/bob/remove/", "/races/open-race/cancel/"),
            "/races/open-race/close/",
            *("/races/show-race/live/phone/", "/races/show-race/live/screen/", "/races/show-race/live/commentary/"),
            *("/races/show-race/live/overlay/tower/", "/races/robin/live/screen/"),
            *("/races/open-race/invited/", f"/invitations/stop/{stop_token('a@example.org')}/"),
            *("/classes/", "/classes/7c/", "/classes/7c/lti/", "/class/", "/class/ABCDEFGHJKMN/"),
            *("/assignments/", "/assignments/new/", "/assignments/copy/7c/"),
            *(f"/assignments/{assigned['task']}/", f"/assignments/{assigned['draft']}/parts/new/"),
            f"/attempts/{assigned['attempt']}/",
            *(
                f"/assignments/{assigned['assignment']}/{page}"
                for page in ("", "edit/", "parts/1/", "exceptions/", "marks/", "regrade/", "log/")
            ),
            *("/teams/", "/teams/new/", "/teams/comets/", f"/teams/join/{Team.objects.get().code}/"),
            *("/races/open-race/?by=teams",),
            *("/groups/", "/groups/new/", "/groups/owls/", f"/groups/join/{RacerGroup.objects.get(name='Owls').code}/"),
            *("/races/open-race/withdraw/", "/races/waiting-race/", "/races/fault-race/", "/races/next-race/"),
            *("/races/old-race/", "/races/no-race/", "/races/secret-race/", "/races/robin/", "/races/robin/duels/"),
            *(f"/evaluations/{runs[name]}/" for name in ("queued", "failed", "finished")),
            *(f"/evaluations/{driven.public_id}/", f"/evaluations/{driven.public_id}/?colour=lap&lap=2"),
            *(f"/evaluations/{driven.public_id}/replay/", f"/evaluations/{driven.public_id}/saw/?lap=2&ms=400"),
            f"/evaluations/{driven.public_id}/replay/?with={chased.public_id}",
            *(
                "/runs/",
                "/runs/new/",
                "/runs/new/?race=open-race",
                f"/evaluations/{own[0]}/",
                f"/evaluations/{own[1]}/",
            ),
            f"/evaluations/{own[0]}/delete/",
            *("/reports/", "/reports/new/", f"/reports/{done}/", f"/reports/{waits}/", f"/reports/{done}/delete/"),
            *("/models/", "/models/upload/", "/models/shared/", f"/models/{world.model.public_id}/"),
            *(f"/models/{world.model.public_id}/edit/", f"/models/{world.model.public_id}/delete/"),
            *("/vehicles/", "/vehicles/new/", f"/vehicles/{vehicle.public_id}/"),
            *(f"/vehicles/{vehicle.public_id}/delete/", "/train/", "/train/new/"),
            *(one.get_absolute_url() for one in Sweep.objects.all()),
            f"{Sweep.objects.get(name='swept').get_absolute_url()}delete/",
            *(f"/train/{trained.public_id}/", f"/train/{training.public_id}/", f"/train/{trained.public_id}/delete/"),
            *(
                "/learn/",
                "/learn/laboratory/",
                "/learn/elsewhere/",
                "/learn/real-car/",
                *(f"/learn/{each.slug}/" for each in LESSONS),
            ),
            *("/tracks/", "/tracks/oval/", "/tracks/oval/print/", "/tracks/oval/drive/", "/tracks/import/"),
            *("/seasons/", at, f"{at}standings/", f"{at}finales/", f"{at}rules/", f"{at}calendar/"),
            *(
                f"{at}racers/alice/",
                "/hall-of-fame/",
                "/cups/",
                f"/cups/{Cup.objects.get().day}/",
                "/racers/alice/",
                "/racers/bob/",
                "/following/",
                "/racers/house-steady/",
                "/notices/",
            ),
            *("/settings/", "/settings/notices/", "/settings/webhooks/", "/settings/tokens/", "/accounts/email/"),
            "/settings/usage/",
            "/settings/alias/",
            "/settings/data/",
            "/settings/data/delete/",
            *("/accounts/password/change/", "/accounts/logout/"),
        ],
        "bob": [f"/evaluations/{runs['running']}/", "/accounts/2fa/", "/accounts/2fa/reauthenticate/"],
        "newcomer": [
            *("/", "/models/", "/train/", "/vehicles/", "/notices/", "/races/open-race/", "/racers/newcomer/"),
            *("/accounts/2fa/", "/accounts/2fa/totp/activate/", "/accounts/2fa/recovery-codes/generate/"),
            *("/accounts/2fa/webauthn/", "/accounts/2fa/webauthn/add/"),
        ],
        "admin": [
            *(
                "/",
                "/seasons/new/",
                *(f"{at}copy/", f"{at}delete/"),
                "/workers/",
                "/lti/",
                "/workers/evaluations/failed/?hours=0",
                *("/audit/", "/races/open-race/audit/", "/needs/", "/programs/", "/programs/program-results/"),
                "/races/open-race/",
                "/usage/",
            ),
            "/spoilers/",
        ],
    }


def names_of_pages() -> set[str]:
    """The names of all addresses that show a page."""
    return {name for name in _names(get_resolver().url_patterns) if name not in NO_PAGES}


def names_walked(site: Site) -> set[str]:
    """The names of the addresses that the walk visits."""
    missing = {path for _, path in site.pages() if path.startswith("/nothing/")}
    return {resolve(path.partition("?")[0]).url_name for _, path in site.pages() if path not in missing}


def _names(patterns) -> Iterator[str]:
    for pattern in patterns:
        if isinstance(pattern, URLPattern):
            if pattern.name and not pattern.name.startswith("api-"):
                yield pattern.name
        elif pattern.namespace != "admin":
            yield from _names(pattern.url_patterns)


COOKIE = settings.SESSION_COOKIE_NAME
