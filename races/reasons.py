"""Why a race, an entry or a submission is refused."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Paddock's own faults",
    unavailable={
        "own_submit_failed": _(
            "Paddock failed to submit the car to the race. The run is valid: submit the car on the race's page."
        ),
        "recheck_late": _("No worker could drive this result again within two days."),
    },
)

register(
    "Races",
    invalid={
        # a race that is made or changed
        "race_field": _("Invalid %(field)s: %(problem)s"),
        "race_field_fixed": _("%(field)s cannot be changed after creation. Create a new race instead."),
        "race_closes_before_opening": _(
            "The race closes before it opens. Choose a closing time after the opening time."
        ),
        "race_opens_in_the_past": _("The opening time has passed. Choose now or a later time."),
        "race_already_over": _("The closing time has passed. Choose a later one."),
        "race_too_long": _("A race lasts at most %(days)s days. Choose an earlier closing time."),
        "race_too_far_ahead": _("The race opens more than %(days)s days from now. Choose an earlier time."),
        "race_minimum_laps": _("The car drives %(laps)s laps. Require at most %(laps)s consecutive laps."),
        "race_total_needs_all_laps": _("Total time counts every lap. Require all %(laps)s laps."),
        "race_sensors": _("Choose one or more different sensors, including a camera: %(known)s."),
        "race_group_is_private": _(
            "This group is private. Make its race by invitation to keep it private; members need no link."
        ),
        "race_needs_division": _("A league race belongs to a division. Choose open or pro."),
        "race_league_is_public": _("League races are public. Only community races can be by invitation."),
        "race_track_without_shape": _(
            "%(track)s has no map: it is only a name from an imported season. Choose a track with a map."
        ),
        "race_community_has_no_division": _("Divisions belong to league races. Leave the division empty."),
        # what stands and drives on the track
        "race_needs_boxes": _(
            "Object avoidance needs boxes: choose 1 to %(most)s fixed positions, or a number of "
            "boxes placed by the seed."
        ),
        "race_has_no_boxes": _("Boxes belong to object avoidance. Remove them, or choose that race type."),
        "race_boxes_fixed_or_random": _("Boxes are either fixed or placed by the seed. Leave one of the two empty."),
        "race_too_many_boxes": _("A race has at most %(most)s boxes. Remove some."),
        "race_boxes_shape": _(
            "Boxes are a list of places, each with a fraction (a number, the share of the lap driven there) and a "
            "lane (%(lanes)s)."
        ),
        "race_box_place": _(
            "Box %(number)s is in the start or finish area. Place boxes between %(least)s and %(most)s of the lap."
        ),
        "race_box_percent": _(
            "Enter the position of box %(number)s as a percentage of the lap, such as 25, and choose its lane."
        ),
        "race_box_distance": _("Enter a minimum distance between boxes of %(least)s to %(most)s m."),
        "race_needs_opponents": _("A head-to-head race is driven against bots or against models. Choose one."),
        "race_has_no_opponents": _(
            "Opponents, bots and duels belong to head-to-head races. Remove them, or choose that race type."
        ),
        "race_bot_count": _("Enter the number of bots, 1 to %(most)s."),
        "race_bot_speed": _("Enter a bot speed of %(least)s to %(most)s m/s."),
        "race_bots_have_no_duels": _("Duels need models as opponents. Leave the duel format empty."),
        "race_duels_have_no_bots": _("Races against models have no bots. Set the number of bots to 0."),
        "race_needs_duel_format": _("Models against models need a format. Choose round robin or bracket."),
        "race_bot_lane_change": _("Enter a lane change length of %(least)s to %(most)s m."),
        "race_bot_change_time": _(
            "The time between lane changes is %(least)s to %(most)s s. Choose a value in this range."
        ),
        "race_bot_change_times": _("The longest time must not be shorter than the shortest."),
        "race_duel_gap": _("Enter a start gap of %(least)s to %(most)s m."),
        "race_duel_cars": _("Enter 2 to %(most)s cars per duel."),
        "race_duel_heats": _("A duel has %(least)s to %(most)s heats. Choose a number in this range."),
        # real cars
        "race_physical_alone": _(
            "Real cars are timed one by one. Choose a time trial or object avoidance for a race of real cars."
        ),
        "race_address_reserved": _("The address %(slug)s belongs to a page of this site. Choose another one."),
        "race_beside": _(
            "The simulated race beside a real-car race must be on the same track, and public or yours. Choose one."
        ),
        "timing_clock_ahead": _(
            "The session begins in the future. Set the clock of the device right, then send again."
        ),
        "guest_name": _("Use 1 to %(most)s characters on one line. The first may not be = + - or @."),
        "lap_numbers": _("Number laps from 1 without gaps, each with a unique id."),
        "laps_too_many": _("A session has at most %(most)s laps. Begin another session."),
        "lap_too_short": _(
            "Lap %(lap)s is shorter than the shortest possible lap of this race (%(shortest)s ms). Mark it invalid or "
            "take it out."
        ),
        "lap_too_long": _("Lap %(lap)s lasts longer than %(minutes)s minutes. Take it out or correct its time."),
        "lap_clock": _(
            "The clock of the device stood still or jumped by %(seconds)s s during lap %(lap)s. Mark that lap invalid."
        ),
        "lap_after_session": _(
            "Lap %(lap)s began after the session's %(seconds)s s were over. Mark it invalid or take it out."
        ),
        "lap_faults": _("Lap %(lap)s has 0 to %(most)s off tracks and resets. Correct the number."),
        "correction_needs_a_reason": _("Say why the lap is corrected. Everybody reads it."),
        "correction_changes_nothing": _("There is no change to save."),
        "sensor_clock_back": _(
            "The sensor's clock went back by %(ms)s ms. Send a new boot id after each restart of the sensor."
        ),
        "sensor_clock_stands": _("The sensor's clock has not moved for %(seconds)s s. Restart the sensor."),
        # laps from a file
        "timing_file": _("Not imported: %(lines)s lines have problems, the first in line %(line)s."),
        "csv_heading": _("The heading has columns that are unknown (%(unknown)s) or lacks some (%(missing)s)."),
        "csv_form": _("This is no CSV. Save the table as comma-separated values in UTF-8."),
        "csv_too_long": _("The file has more than %(most)s laps. Send it in parts."),
        "csv_empty": _("There is no lap in the file."),
        "csv_cells": _("The line has %(cells)s cells and the heading %(columns)s."),
        "csv_who": _("The line names neither a racer nor a guest."),
        "csv_number": _("“%(value)s” is no whole number from %(least)s to %(most)s (%(column)s)."),
        "csv_time": _("“%(value)s” is no time. Write m:ss.mmm or seconds, as 0:12.345 or 12.345."),
        "csv_valid": _("“%(value)s” is neither 1 nor 0. Say whether the lap is valid."),
        "csv_moment": _("“%(value)s” is no moment. Write it as 2026-11-30T14:05:00+09:00."),
        "cancel_needs_a_reason": _("Enter a reason for cancelling. Every entrant will see it."),
        # submitting
        "sensors_not_offered": _(
            "The model reads %(needed)s, which this race does not offer. It offers %(offered)s: choose a model that "
            "was trained with these."
        ),
    },
    unauthorized={
        "sensor_token": _("Invalid sensor token. Send the token shown when the sensor was created."),
        "sensor_revoked": _("The token of this sensor was revoked at %(when)s. Ask the organiser for a new one."),
    },
    forbidden={
        "race_group_not_yours": _("You can hold races for listed groups and for those that you lead."),
        "race_program": _("Programs do not race. Enter with a racer's account."),
        "race_group_only": _("This race is for members of %(group)s alone."),
        "race_not_of_class": _("An account of a class races in the races of its class alone."),
        "race_needs_team": _("This race is for teams. Found one or join one first."),
        "timing_not_yours": _("Only timekeepers of this race can record times. Ask the organiser to add you."),
        "timing_stewards": _("The results are official, so only stewards correct them. Ask the league's admins."),
        "race_league_admins": _("Only admins can create league races. Leave the division empty for a community race."),
        "race_not_yours": _("Only the organiser of this race and admins can do this."),
        "race_needs_invitation": _("This race is by invitation. Open the link that its organiser gave you."),
        "race_terms": _(
            "This race has terms (version %(version)s). Read and accept them on its rules page, then join."
        ),
        "entry_removed": _("The organiser has removed you from this race. Contact them if this is a mistake."),
    },
    not_found={
        "timing_racer_unknown": _(
            "%(racer)s is not in this race. Have them join it, or record them as a guest: laps are taken over later."
        ),
        "guest_unknown": _("This link is invalid or was already used. Ask the organiser for a new one."),
        "timekeeper_unknown": _("There is no racer %(racer)s. Check the alias on their page."),
        "sensor_unknown": _("This race has no such sensor, or its token was revoked. Choose another or time by hand."),
        "invitation_unknown": _("This invitation link is no longer valid. Ask the organiser for the current one."),
        "entry_missing": _("You have not entered this race."),
    },
    conflict={
        "account_organises": _(
            "You organise the race “%(race)s”, which is not over. Close or cancel it first, or ask an admin for "
            "another organiser."
        ),
        "race_team_has_entry": _("A team has one car in this race, and %(racer)s drives for yours."),
        "race_is_physical": _("This race uses real cars. Join it and bring your car to the track."),
        "race_not_physical": _("This race is simulated. It has no timekeeping."),
        "timing_id_taken": _("This id belongs to another race or session. Give each session and lap a new one."),
        "timing_too_late": _("Laps can be sent until %(hours)s hours after the race has closed. Ask the organiser."),
        "timing_final": _(
            "The results of this race are final: the stewards' window is over. Laps can no longer be changed."
        ),
        "sessions_used_up": _("This racer has had all %(limit)s sessions that the race allows."),
        "sessions_overlap": _(
            "%(racer)s was on the track at that time, in session %(number)s. Choose another racer, or correct the "
            "start."
        ),
        "guest_is_racer": _(
            "%(name)s is the alias of a racer in this race. Choose the racer, or give the guest another name."
        ),
        "guest_linked": _("The laps of %(guest)s were taken over already. Ask the organiser if they are yours."),
        "timekeepers_too_many": _("A race has at most %(most)s timekeepers. Dismiss one first."),
        "sensors_too_many": _("A race has at most %(most)s sensors. Revoke one first."),
        "sensor_busy": _("%(sensor)s times another session. End that one first."),
        "sensor_idle": _("No session runs with this sensor. A timekeeper begins one, then crossings count."),
        "csv_session_known": _(
            "The session %(session)s was timed here and its laps are others. Correct them on the page of the laps."
        ),
        "race_limit": _("You already have %(limit)s unfinished races. Wait until one closes, or cancel one."),
        "race_has_opened": _("The race has opened. Its opening time can no longer be changed."),
        "race_is_over": _("The race is over: only its name and its description can be changed."),
        "race_has_submissions": _("Cars have been submitted under these rules. Create a new race to use other rules."),
        "race_not_open_yet": _("The race opens at %(opens)s. Submit a car from then on."),
        "race_changed_meanwhile": _(
            "The race has been edited by someone else since you opened it. Not saved. Reload the page and try again."
        ),
        "race_recorded": _("This is an imported race. It takes no entries."),
        "race_closed": _("The race closed at %(closes)s. Entries and cars can no longer be changed."),
        "race_cancelled": _("The race was cancelled: %(reason)s"),
        "entry_withdrawn": _("You have withdrawn from this race. Enter it again first."),
        "car_already_submitted": _("You have already submitted this car. The same car gives the same result."),
        "car_of_another": _(
            "%(racer)s submitted this car first, and each car has one place in this race. Train it "
            "further, or submit another car. If the car is yours, contact the organiser."
        ),
        "submission_running": _("Your last car is still being timed. Wait for its result, or stop it."),
        "submissions_used_up": _("You have used all %(limit)s submissions in this race."),
        "race_engine_gone": _(
            "This race is over and used the engine %(engine)s. A new run with %(site)s could not be "
            "compared with its results."
        ),
        "submission_not_failed": _("Only failed or stopped runs can be repeated."),
    },
    too_large={
        "csv_too_large": _("The file is larger than %(most)s bytes. Send it in parts."),
    },
)

register(
    "Own runs",
    invalid={
        "own_as_in_race": _(
            "With a race, its track and rules apply and the car drives alone. Remove the race, or "
            "the track, rivals and rules."
        ),
        "own_without_race": _("Automatic submission needs a race. Choose the race, or turn it off."),
        "own_needs_track": _("Choose a track, or a race for its rules."),
        "own_needs_rivals": _("Choose one to three cars to race against, or bots."),
        "own_start": _("The start must be from 0 m to less than the lap length of %(length_m)s m."),
    },
    forbidden={
        "own_only": _(
            "Only your test runs can be repeated or deleted. This run belongs to a race or to another racer."
        ),
    },
    not_found={
        "own_model_gone": _("This model is not in your garage or shared with you. Choose another, or upload it."),
        "own_rival_gone": _("Rival %(number)s is not in your garage or shared with you. Choose another car, or none."),
        "own_race_gone": _("You have no access to this race. Choose another, or a track and rules."),
    },
    conflict={
        "own_runs_at_once": _(
            "You have reached the limit of %(limit)s test runs at a time. Wait for one, or stop one."
        ),
        "own_runs_a_day": _(
            "You have reached the limit of %(limit)s test runs in 24 hours. Try again later, or ask "
            "an operator for more."
        ),
        "own_under_way": _("The run is queued or running. Stop it first, then delete it."),
        "own_race_changed": _("The rules of the race have changed since this run. Run it again."),
        "own_other_engine": _(
            "This race uses the engine %(engine)s and this run %(site)s. Results of different "
            "engines cannot be compared."
        ),
        "own_not_classified": _("Not submitted: these laps would not be classified. Train the car further."),
        "own_not_better": _("Not submitted: no better than your result in this race."),
    },
)

register(
    "Comparing runs",
    invalid={
        "compare_itself": _("This is the same run. Choose another one."),
        "compare_elsewhere": _("That run is on another track, or in the other direction."),
        "compare_engine": _(
            "That run was driven with the engine %(other)s, this one with %(engine)s: their times do not compare."
        ),
        "compare_lap": _("There is no lap %(lap)s that can be compared: the run has %(laps)s."),
    },
    not_found={
        "compare_unknown": _("There is no such run, or you may not see it. Paste the link of a run's page."),
    },
    conflict={
        "compare_no_result": _("Only runs that are finished can be compared."),
    },
)

register(
    "Duels",
    invalid={
        "race_bracket_of_pairs": _("A bracket has duels of two cars. Choose 2 cars per duel, or a round robin."),
    },
    not_found={
        "race_has_no_duels": _("This race has no duels. Duels need a head-to-head race against other racers' cars."),
    },
    conflict={
        "duels_before_closing": _("The duels are drawn once the race has closed, at %(closes)s."),
        "duels_wait_for_qualifying": _("%(count)s cars are still running. The duels are drawn when they finish."),
        "duels_drawn": _("The duels have been drawn. Qualifying is closed."),
    },
)

register(
    "Live events",
    invalid={
        "live_before_draw": _("The duels are drawn when the race closes, at %(closes)s. Let the event start later."),
        "live_in_the_past": _("The start of the live event has passed. Choose a later time."),
        "live_too_far_ahead": _("The live event starts more than %(days)s days from now. Choose an earlier time."),
        "live_time_zone": _("%(zone)s is no time zone. Choose one of the list, such as Europe/Berlin."),
        "live_format": _("%(name)s goes from %(least)s to %(most)s."),
        "live_order": _("The order of a live event is one of these: %(known)s."),
        "live_start": _("The start must be on the lap: 0 m to less than %(length_m)s m after the finish line."),
        "live_message": _("A message to spectators has at most %(most)s characters."),
        "live_speed_mode": _("A speed command is one of these: %(known)s."),
        "live_speed_value": _("The value goes from %(least)s to %(most)s."),
        "live_deputy_self": _("You already control your own car. Name another racer."),
        "live_reaction_unknown": _("There is no such reaction. Those that are: %(known)s."),
    },
    forbidden={
        "live_not_in": _("Only entrants can take part in the live event. Enter the race first."),
        "live_speed_not_yours": _("Only the racer and the deputy they named set this car's speed."),
        "results_hidden": _("You hide results until you have watched the race. Watch it, or have its results shown."),
    },
    not_found={
        "live_slot_unknown": _("There is no such place in the running order."),
        "live_deputy_unknown": _("There is no racer %(alias)s. Write their alias as it is on their page."),
        "certificate_no_place": _("%(racer)s has no place in this race, so there is no certificate."),
    },
    conflict={
        "live_exists": _("This race already has a live event. Change its plan, or cancel it and plan another."),
        "live_with_duels": _("The duels have been drawn; it is too late for a live event."),
        "live_drawn": _("The draw decides the pairs, and a finished duel cannot be moved. Hold or skip it instead."),
        "live_walkover": _("It was not driven: fewer than two of its racers are still in the race."),
        "live_of_real_cars": _("Real cars are timed where they drive. Only races of simulated cars are shown live."),
        "live_changed": _("Another organiser changed this live event. Check it and try again."),
        "live_over": _("The live event is over."),
        "live_not_running": _("The live event is not running."),
        "live_has_begun": _("The live event is running. Only its coming runs can be changed."),
        "live_nobody": _("This race has no entries yet. Wait for the first."),
        "live_slot_state": _("That cannot be done to a place in the running order that is: %(state)s."),
        "live_busy": _("A run is on track. Wait until it is over."),
        "live_nothing_next": _("The running order is empty. Add a racer, or end the event."),
        "live_not_ready": _("This run is still being computed. Try again in a few seconds."),
        "live_interrupted": _("The site was away while this run was shown. Release it to show it from its start."),
        "live_car_queued": _("This racer's car is in the queue. The place is released as soon as the car is ready."),
        "live_no_model": _("This racer has no model to drive with. They choose one in the lobby."),
        "live_left": _("This racer has left the race."),
        "live_absent": _("This racer did not answer the roll call."),
        "live_already_in": _("This racer is in the running order already."),
        "live_submissions_closed": _("The choice of models is closed. Ask the organiser of the live event."),
        "live_called": _("Your run is called or on track. Choose another model once it is over."),
        "live_lobby_closed": _("The lobby is not open yet. It opens an hour before the start."),
        "live_speed_off": _("Racers do not set their car's speed in this live event."),
        "live_speed_called": _("Your run is called. Set how it begins before, or command it once it is on track."),
        "live_speed_not_driving": _("The car is not on track. Set how its next runs begin."),
        "live_speed_full": _("A run takes at most %(most)s commands."),
        "live_speed_late": _("The command could not be computed in time. The car drives on as before."),
        "live_undo_nothing": _("There is nothing to undo."),
        "live_reactions_closed": _("Reactions are open from the lobby until ten minutes after the end."),
        "results_not_yet": _("The results are there once the race, or its live event, has ended."),
        "highlights_none": _("No highlights: this live event has no completed lap, crash or save."),
        "live_undo_late": _("That can no longer be undone: two minutes have passed, or it has gone on since."),
    },
    too_many_requests={
        "live_speed_often": _("A command was just given. Wait %(seconds)s seconds and give the next."),
        "live_reactions_too_many": _("Too many reactions. Wait ten seconds."),
    },
)

register(
    "Commands",
    invalid={
        "rules_senseless": _("Invalid rules: %(problem)s."),
    },
    not_found={
        "race_not_found": _(
            "There is no race %(name)s on this site. The closest names are: %(nearest)s. Use the "
            "address of its page, or the last part of it."
        ),
    },
)
