"""Why something about a season, its rounds or its record is refused."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Races",
    forbidden={
        "race_pro_only": _(
            "This race is for the pro division. Enter this month's open race: its best racers are promoted."
        ),
        "race_open_only": _("You are in the pro division this season. Enter this month's pro race instead."),
    },
)

register(
    "The league",
    invalid={
        # the settings of a season
        "season_cut": _("Invalid promotion share %(percent)s %%. Enter more than 0 and less than 100."),
        "season_points_shape": _("Enter 1 to %(places)s whole numbers from 0 to %(most)s, the winner's points first."),
        "season_points_rise": _(
            "Place %(place)s gets %(points)s points, more than the place above. Points must not increase."
        ),
        "season_more_places_than_cars": _(
            "A finale of %(size)s cars has too few cars for that many championship places. Choose "
            "fewer places or a larger finale."
        ),
        "season_without_races": _("No future month has an open race. Choose a track for one, or a later year."),
        "season_address_reserved": _("The address %(season)s belongs to a page of this site. Choose another."),
        "season_copy_months": _("Copy a season by 1 to %(most)s months."),
        # the rounds of a season
        "round_of_another_division": _("This stage needs a race of the %(division)s. Change the race or the stage."),
        "finale_before_qualifier": _("The finale opens before its qualifier closes at %(closes)s. Open it later."),
        "postpone_hours": _("Enter a delay of 1 to %(most)s whole hours."),
        # webhooks
        "webhook_address": _("Enter an http or https address with a host name, without user name, password and “#”."),
        "webhook_name": _("%(host)s is not a name on the internet. Use a public name or address."),
        "webhook_event": _("Unknown event “%(event)s”. Available events: %(known)s."),
        "webhook_private": _("%(host)s is in a private network or on this machine. Use a public address."),
        # results that become official
        "steward_needs_a_reason": _("Enter a reason. Everyone in the race will see it."),
        # invitations by e-mail
        "invited_file": _("The file is not text in UTF-8, or larger than %(limit_kb)s kB. Nobody was invited."),
        "invited_none": _("The list holds no e-mail address. Nobody was invited."),
        "invited_too_many": _("These are more than %(limit)s addresses. Invite them in parts."),
        # a season that is imported
        "import_no_folder": _(
            "%(file)s is missing or unreadable. Use a folder with races.csv and the files listed in it."
        ),
        "import_not_text": _("%(file)s is not a CSV file in UTF-8: %(problem)s."),
        "import_columns": _("%(file)s has no column %(columns)s. Export it again with all columns."),
        "import_cells": _("%(file)s, row %(row)s: there are %(found)s cells for %(columns)s columns."),
        "import_no_season": _("races.csv has no race of the season %(season)s. It has: %(seasons)s."),
        "import_empty": _("races.csv has no races."),
        "import_path": _("races.csv, row %(row)s: %(file)s is outside the folder. List files inside it."),
        "import_file_twice": _("races.csv, row %(row)s: %(file)s is listed twice. Each race needs a separate file."),
        "import_value": _("%(file)s, row %(row)s: invalid %(column)s “%(value)s”. Expected: %(expected)s."),
        "import_times": _("races.csv, row %(row)s: the race closes before it opens. Correct its times."),
        "import_row_count": _("%(file)s has %(found)s results; races.csv lists %(listed)s. The file is incomplete."),
        "import_duplicate_racer": _("%(file)s, row %(row)s: %(racer)s is already in row %(other)s."),
        "import_rank": _(
            "%(file)s, row %(row)s: rank %(rank)s with the score %(score)s contradicts rank %(other_rank)s with "
            "%(other_score)s."
        ),
    },
    forbidden={
        "cup_not_drawn": _("This is the knock-out of a cup. Only racers drawn into this division race in it."),
        "race_not_in_field": _("Only qualified racers can enter this race."),
        "steward_is_no_admin": _("Only admins can change official results."),
    },
    not_found={
        "not_in_the_race": _("%(racer)s has no entry in %(race)s."),
    },
    conflict={
        "season_changed_meanwhile": _(
            "The season has been edited by someone else since you opened it. Not saved. Reload the page and try again."
        ),
        "season_is_official": _("Official results depend on %(fields)s. Revoke the official rounds first."),
        "season_exists": _("The address %(season)s is already taken. Choose another."),
        "season_has_opened": _("%(race)s has opened and cannot be deleted. Cancel it instead."),
        "season_has_entries": _("%(race)s has entries and cannot be deleted. Cancel it instead."),
        "rounds_overlap": _("%(race)s and %(other)s overlap. A division has one race at a time. Change the times."),
        "webhook_limit": _("You have reached the limit of %(limit)s webhooks. Delete one first."),
        "webhook_test_limit": _("You have sent %(limit)s test deliveries in one hour. Try again later."),
        "round_not_over": _("The race is open until %(closes)s. Its results become official after that."),
        "round_still_driving": _("%(waiting)s cars are still running. The results become official after the last."),
        "round_cancelled": _("The race was cancelled and has no results."),
        "round_out_of_order": _("%(race)s closed earlier and is not official yet. Publish rounds in order."),
        "round_not_official": _("The results are not official yet. Corrections come after that."),
        "steward_window_over": _("The steward window ended at %(ended)s. The results of this round are final."),
        "reopen_later_first": _("%(race)s became official later and may depend on this round. Revoke it first."),
        "reopen_field_drives": _(
            "%(race)s has opened with the field from this round. The round can no longer be changed."
        ),
        "invitation_taken": _("This invitation was accepted already."),
        "invitations_a_day": _("You can invite %(limit)s addresses in 24 hours. Invite fewer, or continue tomorrow."),
        "import_season_differs": _(
            "The season %(season)s has already been imported from other files. Delete it to import it again."
        ),
        "import_numbers_differ": _(
            "The season %(season)s has already been imported with another %(number)s. Omit the "
            "numbers to keep it, or delete it to import it again."
        ),
        "import_season_exists": _("A season %(season)s already exists here and was not imported. It was not changed."),
        "export_folder_used": _("%(folder)s is not empty. Choose a new or empty folder."),
    },
    too_many_requests={
        "invitation_too_soon": _("This address was written to less than a day ago."),
    },
)
