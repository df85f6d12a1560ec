"""Reason codes of courses."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Courses",
    invalid={
        "assignment_closes_before_opening": _("The deadline is not after the opening. Choose a later one."),
        "assignment_last_before_due": _(
            "The last moment for late attempts is not after the deadline. Choose a later one."
        ),
        "assignment_time_zone": _("Unknown time zone %(zone)s. Use a name such as Europe/Berlin."),
        "assignment_first_k": _("Enter how many of the first attempts count, for that choice only."),
        "assignment_no_parts": _("The assignment has no parts. Add one."),
        "assignment_too_many_parts": _("An assignment has at most %(limit)s parts."),
        "assignment_pass_rule": _("Unknown rule for passing: %(rule)s."),
        "assignment_rules": _("Invalid race rules: %(problem)s."),
        "assignment_value": _("Enter %(name)s as a whole number from %(least)s to %(most)s."),
        "assignment_value_bool": _("Enter true or false for %(name)s."),
        "assignment_value_choice": _("Choose one of the given values for %(name)s."),
        "assignment_value_name": _("The rule for passing has no value %(name)s."),
        "assignment_thresholds": _("Enter 1 to 20 times, each with points of at least 0, for %(name)s."),
        "assignment_threshold_points": _("A time gives more points than the part has."),
        "assignment_laps": _("The rule needs %(needed)s laps, but only %(laps)s are driven. Raise the laps driven."),
        "assignment_no_tracks": _("Part %(number)s has no tracks. Choose one."),
        "assignment_track_twice": _("Part %(number)s has a track twice."),
        "assignment_too_many_tracks": _("A part has at most %(limit)s tracks."),
        "assignment_too_many_tracks_in_all": _("All parts together have at most %(limit)s tracks."),
        "assignment_candidates": _(
            "Choose at least as many candidates as hidden tracks are drawn, and none if none are drawn."
        ),
        "assignment_candidate_imported": _(
            "%(track)s was imported by somebody who does not teach the group, and could become known. Choose "
            "candidates from the catalogue or your own tracks."
        ),
        "extension_too_early": _("The extension is not after the deadline. Choose a later one."),
        "submission_group_size": _("Choose at least one student for the submission group."),
    },
    forbidden={
        "assignment_not_yours": _("Only teachers of the group can do this."),
        "attempt_students_only": _("Only students of the group can hand in."),
    },
    not_found={
        "class_learner_unknown": _("An alias is no learner of this class. Nothing was changed."),
        "assignment_student_unknown": _("This racer is no student of the group."),
        "assignment_gone": _("The assignment was deleted."),
    },
    conflict={
        "marks_not_exported": _(
            "There are marks that nobody has downloaded as they are now. Download all marks first, then delete."
        ),
        "submission_group_taken": _("A student is in another submission group of the assignment. Nothing was changed."),
        "submission_group_name_taken": _("Another submission group of the assignment has this name."),
        "attempt_not_open_yet": _("The assignment opens at %(opens)s."),
        "attempt_too_late": _("The deadline has passed. Ask the teacher for an extension."),
        "attempts_used_up": _("All %(limit)s attempts are used up."),
        "attempts_wait": _("%(limit)s of your attempts wait for their runs. Hand in again when one is over."),
        "attempts_of_day_used_up": _("All %(limit)s attempts of today are used up. Try again tomorrow."),
        "attempt_already_submitted": _(
            "This car is the latest attempt already: it would drive the same. Hand in another one."
        ),
        "attempt_refunded_already": _("The attempt was given back before."),
        "assignment_has_begun": _(
            "Students have handed in, so tracks and race rules cannot be changed any more. Make a new assignment."
        ),
        "assignment_drawn": _(
            "The hidden tracks have been drawn, so the deadline cannot be moved. Give extensions instead."
        ),
        "assignments_at_once": _("You have %(limit)s assignments that are not over. Wait for one, or ask an admin."),
        "submission_group_in_use": _("The submission group has handed in and cannot be deleted."),
        "regrade_done_already": _("The marks are already by the present rules."),
        "regrade_changed": _("Rules or results have changed since this was computed. Look at the new marks first."),
    },
)

register(
    "Learning platforms (LTI)",
    invalid={
        "lti_expired": _(
            "This launch has expired, was used already, or was started in another browser. Open the link on your "
            "learning platform again. If that fails, allow cookies or open it in a new window."
        ),
        "lti_log_in": _("The log-in request of the learning platform is incomplete. Ask its admin."),
        "lti_message": _("This message of the learning platform cannot be read. Ask its admin."),
        "lti_no_course": _("The link must be opened inside a course of the learning platform."),
    },
    unauthorized={
        "lti_token": _("The learning platform's token is not valid. Open the link again; if it fails, ask an admin."),
    },
    forbidden={
        "lti_account": _(
            "A learning platform logs in no admin, no class account of another course, and no account with a second "
            "factor. Use another account."
        ),
        "lti_deployment": _("This deployment of the learning platform is not registered here. Ask an admin."),
        "lti_role": _("Only students and teachers of the course can open this link."),
    },
    not_found={
        "lti_platform_unknown": _(
            "No learning platform with this issuer and client ID is registered here, or it is not active. Ask an admin."
        ),
    },
    conflict={
        "lti_account_taken": _("This account or this person is linked with another one already. Ask an admin."),
        "lti_address": _("The address of %(host)s is not one that this site may ask. Ask an admin."),
        "lti_no_class": _("No class is linked with this course yet. Its teacher must open the link first."),
        "lti_line": _("The course has no column for this assignment, and the platform lets the site create none."),
        "lti_refused": _("The platform refused the mark with status %(status)s. Look at the column in its grade book."),
        "lti_scope": _("The platform does not let the site send marks. Its admin allows the tool to send grades."),
        "lti_token_refused": _("The platform gave no token for sending marks (status %(status)s). Ask its admin."),
    },
    too_many_requests={
        "lti_too_many": _("Too many launches from your network. Open the link again in a minute."),
    },
    unavailable={
        "lti_unreachable": _("%(host)s does not answer. Try again later."),
    },
)
