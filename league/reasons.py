"""Why something about a season, its rounds or its record is refused."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Races",
    "user",
    {
        "race_pro_only": _(
            "This is a race of the pro division. The best of each month's open race are promoted to it: enter that one."
        ),
        "race_open_only": _(
            "You are in the pro division this season, so this month's pro race is yours, not this one."
        ),
    },
)

register(
    "The league",
    "user",
    {
        # the settings of a season
        "season_cut": _("%(percent)s %% cannot be promoted: choose more than 0 and less than 100 per cent."),
        "season_points_shape": _(
            "The points are a list of 1 to %(places)s whole numbers from 0 to %(most)s, the winner's first."
        ),
        "season_points_rise": _(
            "Place %(place)s would get %(points)s points, more than the place before it. A table of points never rises."
        ),
        "season_more_places_than_cars": _(
            "A finale of %(size)s cars cannot qualify more than all of them. Choose fewer places or a larger finale."
        ),
        "season_without_races": _(
            "No month that is still to come has an open race. Choose a track for one, or a later year."
        ),
        "season_changed_meanwhile": _(
            "Somebody else has changed the season or its rounds since you opened it. Nothing was saved: open it again "
            "and change what stands there now."
        ),
        "season_is_official": _(
            "Results of this season are official, and %(fields)s made them, so that stays. Take the official rounds "
            "back first."
        ),
        "season_exists": _("The address %(season)s is taken already. Choose another one."),
        # the rounds of a season
        "rounds_overlap": _(
            "%(race)s and %(other)s overlap: a division has one race at a time. Choose times that follow each other."
        ),
        "round_of_another_division": _(
            "A race of this stage belongs to the %(division)s. Change the race or the stage."
        ),
        "finale_before_qualifier": _(
            "The finale opens before its qualifier closes at %(closes)s, so nobody would be in it. Open it later."
        ),
        "cup_not_drawn": _("This is the knock-out of a cup: those who were drawn into this division race it."),
        "race_not_in_field": _("The field of this race is given: it is raced by those who qualified for it."),
        "postpone_hours": _("A race is postponed by 1 to %(most)s whole hours."),
        # webhooks
        "webhook_address": _("A webhook is an http or https address without a name and password in it."),
        "webhook_event": _("There is no event “%(event)s”. These can be told: %(known)s."),
        "webhook_private": _("%(host)s leads into a private network or to this machine. Use a public address."),
        "webhook_limit": _("You have %(limit)s webhooks, as many as you may have. Remove one first."),
        "webhook_test_limit": _(
            "You have sent %(limit)s test deliveries within an hour. Wait before you send another."
        ),
        # results that become official
        "round_not_over": _("The race goes on until %(closes)s. Its results become official after that."),
        "round_still_driving": _(
            "%(waiting)s cars that were sent in time are still being timed. The results become official after the last."
        ),
        "round_cancelled": _("The race was cancelled, so nothing comes of it."),
        "round_out_of_order": _("%(race)s closed earlier and is not official yet. Rounds become official in turn."),
        "round_not_official": _("The results are not official yet, so there is nothing to correct."),
        "steward_window_over": _("The steward window ended at %(ended)s. The results of this round are final."),
        "steward_needs_a_reason": _("Say why: everybody in the race will read it."),
        "steward_is_no_admin": _("Only admins decide about official results."),
        "not_in_the_race": _("%(racer)s has no entry in %(race)s."),
        "reopen_later_first": _(
            "%(race)s became official after this round and may follow from it. Take that one back first."
        ),
        "reopen_field_drives": _("%(race)s has opened with the field that came of this round, so the round stands."),
        # invitations by e-mail
        "invitation_taken": _("This invitation was accepted already."),
        "invitation_too_soon": _("This address was written to less than a day ago."),
        "invitations_a_day": _("You may invite %(limit)s addresses in 24 hours. Invite fewer, or go on tomorrow."),
        "invited_addresses": _("There is no e-mail address in line %(line)s, or one that is none. Nobody was invited."),
        "invited_file": _("The file is not text in UTF-8, or larger than %(limit_kb)s kB. Nobody was invited."),
        "invited_none": _("There is no address to invite."),
        "invited_too_many": _("These are more than %(limit)s addresses. Invite them in parts."),
        # a season that is imported
        "import_no_folder": _("There is no readable %(file)s. Name a folder with races.csv and the files it names."),
        "import_not_text": _("%(file)s is not a CSV file in UTF-8: %(problem)s."),
        "import_columns": _("%(file)s has no column %(columns)s. Export it again with all columns."),
        "import_cells": _("%(file)s, row %(row)s: there are %(found)s cells for %(columns)s columns."),
        "import_no_season": _("races.csv has no race of the season %(season)s. It has: %(seasons)s."),
        "import_empty": _("races.csv has no races."),
        "import_path": _("races.csv, row %(row)s: %(file)s lies outside the folder. Name files inside it."),
        "import_file_twice": _("races.csv, row %(row)s: %(file)s was named before. Each race has its own file."),
        "import_value": _("%(file)s, row %(row)s: %(column)s cannot be “%(value)s”. It is %(expected)s."),
        "import_times": _("races.csv, row %(row)s: the race closes before it opens. Correct its times."),
        "import_row_count": _("%(file)s has %(found)s results, and races.csv says %(said)s. The file is not whole."),
        "import_duplicate_racer": _("%(file)s, row %(row)s: %(racer)s was in row %(other)s already."),
        "import_rank": _(
            "%(file)s, row %(row)s: rank %(rank)s with the score %(score)s contradicts rank %(other_rank)s with "
            "%(other_score)s."
        ),
        "import_season_differs": _(
            "The season %(season)s was imported before from other files. A season is imported once; delete it to "
            "import it again."
        ),
        "import_numbers_differ": _(
            "The season %(season)s was imported before with another %(number)s. Leave the numbers out to see it as it "
            "is, or delete it to import it again."
        ),
        "import_season_exists": _("There is a season %(season)s here that was not imported. It stays as it is."),
        "export_folder_used": _("%(folder)s is not empty. Name a folder that is new or empty."),
    },
)
