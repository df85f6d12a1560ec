"""Reasons of one kind have one HTTP status: rules on the names of codes, and a list of those without such a name."""

from __future__ import annotations

import re

import pytest
from rest_framework.test import APIRequestFactory

from core.api.errors import handle
from paddock.errors import PaddockError, PlatformFault, UserFault
from paddock.errors.reasons import KINDS, REASONS, Reason, register
from tests.docs import reason_table  # noqa: F401  (loads the reasons of every room)

# The first rule that a name matches gives its status.
RULES = (
    (400, r"^(boxes|archive)_overlap$|^race_already_over$|^(reward|trace_number)_too_large$"),  # values of the input
    (400, r"^(training_hyperparameter|reward_param|rules|live_reaction|video_lap)_unknown$"),  # choices and numbers
    (409, r"^race_engine_gone$|_not_over$"),
    (401, r"_token$|^token_|_revoked$"),
    (403, r"_not_yours$|_only$|_not_in(_field)?$|_is_no_admin$|_needs_(invitation|team)$|_by_invitation$|_hidden$"),
    (404, r"_unknown$|_not_found$|_gone$|_no_such_\w+$|_not_a_member$|^not_in_the_race$|^not_on_site$"),
    (413, r"(^|_)too_(large|big)$|_too_many_pixels$|^expanded_size$"),
    (429, r"_often$|_too_soon$|_too_many_codes$|_reactions_too_many$|^streams_of_"),
    (409, r"_at_once$|_a_day$|_limit$|_full$|_used_up$|_kept$|_minutes_left$"),  # quotas
    (409, r"_(taken|exists|known|linked)$|_already(_in)?$|_already_submitted$|_overlap$"),  # a second one
    (
        409,
        r"_over$|_closed$|_final$|_(too|undo|speed)_late$|_cancelled$|_recorded$|_(has|have)_(opened|begun|entries|submissions|races)$",
    ),
    (409, r"_not_(yet|open_yet|running|ready|official|failed|finished|driving|there|empty)$|_no_result$|_off$"),
    (409, r"_under_way$|_running$|_still_driving$|_busy$|_idle$|_in_use$|_drawn$|_before_closing$|_wait_for_\w+$"),
    (409, r"_meanwhile$|_changed$|_is_official$|_not_empty$|_folder_used$|_first$|^round_out_of_order$|_withdrawn$"),
)
BY_NAME = {
    400: "no_token",
    401: "sso_failed",
    403: "email_unverified second_factor_needed race_league_admins race_terms entry_removed timing_stewards "
    "account_not_confirmed account_log_in_again "
    "team_not_asked class_no_teacher follow_not_this stream_refused learner_shares_nothing cup_not_drawn "
    "race_not_of_class race_program sso_first_log_in sign_up_domain sso_cancelled lti_account lti_deployment lti_role",
    404: "entry_missing certificate_no_place race_has_no_duels sign_up_invitation stream_topic_hidden source_not_kept",
    409: "account_last_admin account_leads_class account_leads_group account_not_deletable account_of_class "
    "program_disabled "
    "alias_of_class alias_reserved alias_same account_organises car_of_another highlights_none training_no_model "
    "reference_undrivable video_no_steps video_no_best_lap reward_check_runs "
    "race_is_physical race_not_physical live_of_real_cars sensors_too_many timekeepers_too_many "
    "team_too_many_invitations too_many_tokens class_too_many class_too_many_teachers follow_too_many "
    "group_is_a_class model_deleted_not_shared import_season_differs import_numbers_differ "
    "guest_is_racer own_other_engine own_not_classified own_not_better live_with_duels live_walkover live_nobody "
    "live_slot_state live_nothing_next live_interrupted live_car_queued live_no_model live_left live_absent "
    "live_called live_speed_called live_undo_nothing training_model_races training_model_drives "
    "race_team_has_entry reopen_field_drives sweep_without_model training_of_sweep attempts_wait marks_not_exported "
    "lti_address lti_line lti_no_class lti_refused lti_scope lti_token_refused",
    429: "lti_too_many",
}
NAMED = {code: status for status, codes in BY_NAME.items() for code in codes.split()}


def expected(reason: Reason) -> int:
    if reason.fault == "platform":
        return 503
    by_rule = (status for status, pattern in RULES if re.search(pattern, reason.code))
    return NAMED.get(reason.code) or next(by_rule, 400)


def test_every_code_has_the_status_of_its_kind():
    assert {code: reason.status for code, reason in REASONS.items()} == {
        code: expected(reason) for code, reason in REASONS.items()
    }
    assert NAMED.keys() <= REASONS.keys()


@pytest.mark.parametrize("status", KINDS.values())
def test_the_api_answers_with_the_status_of_the_reason(status):
    for reason in REASONS.values():
        if reason.status == status:
            kind: type[PaddockError] = UserFault if reason.fault == "user" else PlatformFault
            answer = handle(kind(reason.code), {"request": APIRequestFactory().get("/")})
            assert (answer.status_code, answer.data["code"]) == (status, reason.code)
            assert answer.has_header("Retry-After") == (status in (429, 503))


def test_a_status_is_registered_with_its_sentences(monkeypatch):
    monkeypatch.setattr("paddock.errors.reasons.REASONS", {})
    made = register("Upload", invalid={"one": "1"}, conflict={"two": "2"}, unavailable={"three": "3"})
    assert {code: (reason.status, reason.fault) for code, reason in made.items()} == {
        "one": (400, "user"),
        "two": (409, "user"),
        "three": (503, "platform"),
    }
    with pytest.raises(ValueError, match="four"):
        register("Upload", invalid={"four": "4"}, conflict={"four": "4"})
    with pytest.raises(ValueError, match="no_kind"):
        register("Upload", no_kind={"five": "5"})
