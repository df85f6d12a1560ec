"""Whatever a racer can change on the pages of the site, a program can change through the API."""

from __future__ import annotations

from collections.abc import Iterator
from uuid import UUID

import pytest
from django.test import Client
from django.urls import URLPattern, URLResolver, get_resolver, reverse

from tests.api.schema import SCHEMA

pytestmark = pytest.mark.django_db
WRITES = ("post", "put", "patch", "delete")

# the name of a page that takes a POST: the operations that do what it does
SAME: dict[str, set[str]] = {
    "alias": {"change_alias"},
    "own_account_delete": {"delete_account"},
    "api_token_revoke": {"revoke_token"},
    "api_tokens": {"create_token"},
    "cup_starter": {"choose_cup_starter", "drop_cup_starter"},
    "enter": {"enter_race"},
    "evaluation_stop": {"stop_evaluation"},
    "evaluation_video": {"ask_for_video"},
    "model_delete": {"delete_model"},
    "model_edit": {"describe_model"},
    "model_share": {"describe_model"},
    "model_upload": {"upload_model"},
    "notice_open": {"mark_notice_read"},
    "notice_settings": {"choose_notices"},
    "notices_read": {"mark_notices_read"},
    "own_again": {"repeat_evaluation"},
    "own_delete": {"delete_evaluation"},
    "own_new": {"create_evaluation"},
    "program": {"change_program", "create_program_token", "replace_program_token", "revoke_program_token"},
    "programs": {"create_program"},
    "race_cancel": {"cancel_race"},
    "race_close": {"close_race"},
    "race_draw": {"draw_duels"},
    "race_edit": {"edit_race"},
    "race_invitation": {"accept_invitation"},
    "race_invitation_reset": {"reset_invitation"},
    "race_spectators_renew": {"renew_spectator_link"},
    "race_new": {"create_race"},
    "race_racer_remove": {"remove_entry"},
    "race_racer_restore": {"restore_entry"},
    "reward_audit": {"audit_reward"},
    "reward_validate": {"validate_reward"},
    "season_continues": {"edit_season"},
    "season_copy": {"copy_season"},
    "season_delete": {"delete_season", "delete_round"},
    "settings": {"change_profile"},
    "submit": {"submit_model"},
    "sweep_delete": {"delete_sweep"},
    "sweep_stop": {"stop_sweep"},
    "track_import": {"import_track"},
    "training_evaluate": {"evaluate_training"},
    "training_delete": {"delete_training"},
    "training_first": {"create_training"},
    "training_new": {"create_training"},
    "training_stop": {"stop_training"},
    "vehicle_delete": {"delete_vehicle"},
    "vehicle_edit": {"change_vehicle"},
    "vehicle_new": {"add_vehicle"},
    "video_stop": {"stop_video"},
    "webhook_remove": {"remove_webhook"},
    "webhook_secret": {"change_webhook_secret"},
    "webhook_test": {"test_webhook"},
    "webhooks": {"add_webhook"},
    "follow": {"follow_racer"},
    "guest_claim": {"claim_guest"},
    "guest_link": {"link_guest"},
    "lap_correct": {"correct_lap"},
    "live_act": {"act_live"},
    "live_highlights": {"ask_for_live_highlights"},
    "live_mine": {"take_part_live"},
    "live_plan": {"change_live", "plan_live"},
    "live_speed": {"command_live_speed", "name_live_deputy"},
    "race_timing_setup": {"make_sensor", "name_timekeeper", "take_laps"},
    "report_again": {"repeat_report"},
    "report_delete": {"delete_report"},
    "report_new": {"create_report"},
    "report_stop": {"stop_report"},
    "sensor_revoke": {"revoke_sensor"},
    "classroom": {
        *("add_learners", "add_teacher", "change_class", "delete_class", "remove_learner", "remove_teacher"),
        *("change_learner", "renew_codes"),
    },
    "classrooms": {"create_class"},
    "assignment": {"hand_in"},
    "assignment_delete": {"delete_assignment"},
    "assignment_edit": {"change_assignment"},
    "assignment_new": {"create_assignment"},
    "assignment_part": {"change_assignment"},
    "assignment_part_new": {"change_assignment"},
    "assignment_publish": {"publish_assignment"},
    "assignment_regrade": {"propose_regrade", "apply_regrade"},
    "assignment_students": {
        *("give_extension", "end_extension", "create_submission_group", "delete_submission_group"),
        *("add_reference", "remove_reference"),
    },
    "attempt_refund": {"refund_attempt"},
    "group_assignments_delete": {"delete_assignment"},
    "group": {"change_group", "change_group_member", "delete_group", "remove_group_member", "renew_group_link"},
    "group_join": {"join_group"},
    "group_leave": {"leave_group"},
    "group_new": {"create_group"},
    "team": {
        *("accept_team_invitation", "change_team_member", "invite_to_team", "remove_team_invitation"),
        *("remove_team_member", "renew_team_link"),
    },
    "team_join": {"join_team"},
    "team_leave": {"change_profile", "leave_team"},
    "team_new": {"change_profile", "found_team"},
    "timekeeper_dismiss": {"dismiss_timekeeper"},
    "timekeeper_name": {"name_timekeeper"},
    "unfollow": {"unfollow_racer"},
    "withdraw": {"withdraw"},
}
# what a program cannot do, and why that is right
ONLY_ON_PAGES: dict[str, str] = {
    "account_confirm_login_code": "logging in: a program has a token",
    "account_login": "logging in: a program gets a token for a password",
    "account_logout": "of a browser's session: a program gives its token back",
    "account_signup": "a person joins, and chooses a password that no program knows",
    "account_reauthenticate": "of a browser's session",
    "account_confirm_email": "the link in a mail, opened by who reads it",
    "account_email": "with the address the account could be taken over: a token alone must not be enough",
    "account_change_password": "with the password the account could be taken over: a token alone must not be enough",
    "account_set_password": "likewise",
    "account_reset_password": "of who cannot log in",
    "account_reset_password_from_key": "the link in a mail",
    **dict.fromkeys(
        (
            "mfa_activate_totp",
            "mfa_add_webauthn",
            "mfa_deactivate_totp",
            "mfa_download_recovery_codes",
            "mfa_edit_webauthn",
            "mfa_generate_recovery_codes",
            "mfa_remove_webauthn",
        ),
        "without the second factor the account could be taken over: a token alone must not be enough",
    ),
    "mfa_authenticate": "logging in: a program sends the code with the password",
    "mfa_login_webauthn": "logging in with a passkey, which a browser holds",
    "mfa_reauthenticate": "of a browser's session",
    "mfa_reauthenticate_webauthn": "of a browser's session",
    "notices_stop": "the link in a mail, which works without logging in; choose_notices does the same",
    "own_layout": "a map for who places boxes by hand; asking for the run says what is wrong with it",
    "race_layout": "draws the map of a form that is being filled in; it changes nothing",
    "reward_lab": "draws a map of a reward function along a drive; it changes nothing",
    "failed_runs": "for who runs the site",
    "season_new": "an admin's form",
    "car_choose": "a word beside the board on whose model drives a real car; no result hangs on it",
    "assignments_copy": "a program creates the copies by create_assignment",
    **dict.fromkeys(
        ("lti_arrival", "lti_choose", "lti_launch", "lti_log_in"), "logging in from a learning platform, in a browser"
    ),
    "class_lti": "sends again what a learning platform refused, for who reads there why",
    "class_code": "logging in with a card",
    "class_log_in": "logging in with a card",
    **dict.fromkeys(("invited", "invited_stop"), "the link in a mail, which works without logging in"),
    "live_react": "applause of who watches",
    "data_download": "an operation that reads, GET /me/data/; the page asks for the password first",
    **dict.fromkeys(("picture_remove", "picture_set"), "a picture of a person, chosen and looked at by that person"),
    "race_invited": "mails to people: a program would send them in numbers",
    "spoilers": "of who reads pages: a program sends X-Paddock-Spoilers",
    "set_language": "of a browser: a program sends Accept-Language",
    "theme": "of a browser",
}


def pages(below: URLResolver, prefix: str = "", above: frozenset[str] = frozenset()) -> Iterator[tuple[str, set[str]]]:
    """Name and parameters of every page outside the API and the admin site."""
    for one in below.url_patterns:
        path = prefix + str(one.pattern)
        if path.startswith(("admin/", "api/")):
            continue
        if isinstance(one, URLResolver):
            yield from pages(one, path, above | one.pattern.converters.keys())
        elif isinstance(one, URLPattern):
            yield one.name, {*above, *one.pattern.converters, *one.pattern.regex.groupindex}


def takes_a_post(client: Client, name: str, parameters: set[str]) -> bool:
    """Whether a POST by somebody who may do everything is met by anything but "405: this page is only read"."""
    given = {one: {"form": "json", "id": str(UUID(int=1))}.get(one, "1") for one in parameters}
    return client.post(reverse(name, kwargs=given)).status_code != 405


@pytest.fixture
def written(sam) -> set[str]:
    """The pages that take a POST, asked one by one."""
    found = set()
    for name, parameters in pages(get_resolver()):
        client = Client(raise_request_exception=False)
        client.force_login(sam, backend="django.contrib.auth.backends.ModelBackend")
        if takes_a_post(client, name, parameters):
            found.add(name)
    return found


@pytest.mark.slow
def test_every_writing_page_has_an_api_operation_or_a_reason(written):
    assert written - SAME.keys() - ONLY_ON_PAGES.keys() == set(), "neither an operation nor an exception"
    assert (SAME.keys() | ONLY_ON_PAGES.keys()) - written == set(), "no page that takes a POST"
    assert SAME.keys() & ONLY_ON_PAGES.keys() == set()


def test_the_named_operations_exist_and_write():
    writing = {
        operation["operationId"]
        for methods in SCHEMA["paths"].values()
        for method, operation in methods.items()
        if method in WRITES
    }
    assert set().union(*SAME.values()) - writing == set()
