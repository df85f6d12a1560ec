"""One entry for every form of the site: who sends it from where, what they fill in, and what they see then.

A form that no entry sends fails the test (tests/pages/test_forms_browser.py), which names it: add an entry.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from league.house_cars.services import HOUSE_CARS_DIR
from paddock.geometry.catalogue import CATALOGUE
from paddock.geometry.files import write_npy
from tests.pages.form_world import PASSWORD, a_picture

CAR = HOUSE_CARS_DIR / "flyer.onnx"
NEW_PASSWORD = "another long passphrase"
A_CAR = [
    {"name": "model.onnx", "mimeType": "application/octet-stream", "buffer": CAR.read_bytes()},
    {"name": "model_metadata.json", "mimeType": "application/json", "buffer": CAR.with_suffix(".json").read_bytes()},
]
LAPS = {"name": "laps.csv", "mimeType": "text/csv", "buffer": b"guest,lap,time\nFred,1,12.5\n"}
A_TRACK = {"name": "t.npy", "mimeType": "application/octet-stream", "buffer": write_npy(CATALOGUE[3].geometry())}
A_PICTURE = {"name": "me.png", "mimeType": "image/png", "buffer": a_picture()}


@dataclass(frozen=True)
class Case:
    """``by`` (guest, newcomer, alice who organises, admin) goes to ``at`` ("" stays), fills in fields by their labels,
    presses the button, and sees ``then``: words that were not there before, or a selector after ``css=``.

    ``inside``: where the button is, where more than one has its name. ``scripts=False``: for what a script does instead
    of the form where there are scripts.
    """

    by: str
    at: str
    press: str
    then: str
    fill: dict[str, object] = field(default_factory=dict)
    inside: str = "main"
    scripts: bool = True


CHANGE = "css=[value^='change:']"
LIVE = "/races/open-race/event/console/"


def _logged(action: str) -> str:
    """That an act is the latest in the log of a live event."""
    return f"css=.console-log li:first-child[data-act={action}]"


STEWARD = "#steward-actions"
STOP = "css=form[action$='/{report_listed}/stop/'] button"
CASES = [
    # in the head of every page
    Case("guest", "/about/", "한국어", "css=html[lang=ko]", inside="header"),
    Case("guest", "/about/", "EN", "css=html[lang=en]", inside="header"),
    Case("guest", "/about/", "Dark or light", "css=html[data-theme=dark]", inside="header", scripts=False),
    # an account
    Case(
        "guest",
        "/accounts/signup/",
        "Sign up",
        "Welcome, fresh.",
        {"Alias": "fresh", "Email": "f@example.org", "Password": PASSWORD, "Password (again)": PASSWORD},
    ),
    Case("guest", "/", "css=form[action='/train/first/'] button", "css=#training-state"),
    Case("guest", "", "Log out", "You are logged out.", inside="header"),
    Case(
        "guest",
        "/accounts/login/",
        "Log in",
        "Welcome, alice",
        {"Alias or e-mail address": "alice", "Password": PASSWORD},
    ),
    Case("guest", "/accounts/logout/", "Log out", "You are logged out."),
    Case("guest", "/accounts/password/reset/", "Send the link", "Check your e-mail", {"Email": "bob@example.org"}),
    Case(
        "guest",
        "/accounts/password/reset/key/{reset}/",
        "Save the password",
        "Password changed",
        {"New Password": NEW_PASSWORD, "New Password (again)": NEW_PASSWORD},
    ),
    Case("guest", "/accounts/confirm-email/{confirm}/", "Yes, confirm", "is confirmed"),
    Case("guest", "/notices/stop/{stop}/", "Unsubscribe", "Turned off:"),
    Case("guest", "/races/join/{invitation}/", "Log in and join", "css=input[name=login]"),
    Case("guest", "/races/join/{invitation}/", "Sign up and join", "css=input[name=password2]"),
    Case(
        "guest",
        "/accounts/signup/",
        "Sign up",
        "Welcome, leaver.",
        {"Alias": "leaver", "Email": "l@example.org", "Password": PASSWORD, "Password (again)": PASSWORD},
    ),
    Case("guest", "/settings/alias/", "Change the alias", "Next change possible", {"New alias": "quitter"}),
    Case(
        "guest",
        "/settings/data/delete/",
        "Delete my account",
        "css=input[type=password]",
        {"Type your alias to confirm": "quitter"},
    ),
    Case("guest", "", "Continue", "Your account is deleted.", {"Password": PASSWORD}),
    Case("newcomer", "/races/join/{invitation}/", "Join the race", "You have joined."),
    Case(
        "newcomer",
        "/accounts/password/set/",
        "Save the password",
        "Password changed",
        {"Password": PASSWORD, "Password (again)": PASSWORD},
    ),
    Case("newcomer", "/accounts/reauthenticate/", "Continue", "css=.race-card", {"Password": PASSWORD}),
    Case(
        "newcomer", "/accounts/email/", "Change the address", "to new@example.org.", {"New address": "new@example.org"}
    ),
    Case("alice", "/settings/data/", "Download (zip)", "css=input[type=password]"),
    Case("alice", "/accounts/reauthenticate/", "Continue", "css=.race-card", {"Password": PASSWORD}),
    Case("alice", "/accounts/email/", "Send it again", "A link to confirm your address"),
    Case("alice", "", "Keep the old address", "css=main:not(:has([name=action_remove]))"),
    Case(
        "newcomer",
        "/accounts/password/change/",
        "Save the password",
        "Password changed",
        {"Current Password": PASSWORD, "New Password": NEW_PASSWORD, "New Password (again)": NEW_PASSWORD},
    ),
    Case("alice", "/settings/", "Save", "Saved.", {"Country": "Germany"}),
    Case("alice", "/settings/", "Use this picture", "css=img.avatar", {"A picture of yours": A_PICTURE}),
    Case("alice", "/settings/", "Remove my picture", "Your picture is removed."),
    Case("alice", "/settings/tokens/", "Create a token", "Your new token"),
    Case("alice", "/settings/tokens/", "Revoke", "Token revoked"),
    Case("alice", "/settings/webhooks/", "Send a test", "Test sent"),
    Case("alice", "/settings/webhooks/", "New secret", "New secret set."),
    Case("alice", "/settings/webhooks/", "Remove", "Webhook deleted"),
    Case("alice", "/settings/webhooks/", "Add a webhook", "Webhook created.", {"Address": "https://example.org/a"}),
    Case("alice", "/settings/notices/", "Save", "Saved."),
    Case(
        "alice",
        "/cups/",
        "Save",
        "Automatic entry is off.",
        {"Car for every cup": "none"},
        inside="#starter",
    ),
    Case("alice", "/notices/", "css=.notice-link", "css=#evaluation, #board"),
    Case("alice", "/notices/", "Mark all as read", "css=main:not(:has([action='/notices/read/']))"),
    Case("alice", "/racers/bob/", "Follow", "You follow bob."),
    Case("alice", "/racers/bob/", "Unfollow", "You no longer follow bob."),
    Case("alice", "/following/", "Unfollow", "You no longer follow slowpoke."),
    # classes
    Case("newcomer", "/classes/", "Create the class", "Class created.", {"Name": "6a"}),
    Case("alice", "/classes/7c/", "Make accounts and cards", "css=.class-card", {"Names": "Ben Park"}),
    Case("alice", "/classes/7c/", "css=#plan button", "Saved."),
    Case("alice", "/classes/7c/", "css=#student-ids [value=ids]", "Saved.", {"Student ID of Ann Lee": "20261"}),
    Case("alice", "/classes/7c/", "css=#learners [value=codes]", "css=.class-card", {"Ann Lee": True}),
    Case("alice", "/classes/7c/", "css=#learners [value=all-codes]", "css=.class-card"),
    Case(
        "alice", "/classes/7c/", "Add the teacher", "bob teaches the class, too.", {"Alias of another teacher": "bob"}
    ),
    Case("alice", "/classes/7c/", "css=[value=remove-teacher]", "bob no longer teaches the class."),
    # assignments
    Case("alice", "/assignments/new/", "Create the draft", "Draft created.", {"Title": "Another one"}),
    Case("alice", "/assignments/{draft}/parts/new/", "Add the part", "Saved.", {"Title": "Clean", "Track": "oval"}),
    Case("alice", "/assignments/{draft}/parts/2/", "css=[value=remove]", "Saved."),
    Case("alice", "/assignments/{draft}/parts/1/", "css=[value=save]", "Saved."),
    Case("alice", "/assignments/{draft}/edit/", "css=[value=save]", "Saved."),
    Case("alice", "/assignments/{draft}/edit/", "Publish the assignment", "Published."),
    Case(
        "alice",
        "/assignments/{draft}/edit/",
        "css=#delete button",
        "Assignment deleted.",
        {"Type the title to confirm": "Draft"},
    ),
    Case("alice", "/assignments/{assignment}/exceptions/", "css=[value=extend]", "Saved.", {"Reason": "Ill"}),
    Case("alice", "/assignments/{assignment}/exceptions/", "css=[value=end-extension]", "Saved."),
    Case(
        "alice",
        "/assignments/{assignment}/exceptions/",
        "css=[value=group]",
        "Saved.",
        {"Name": "Pair", "Ann Lee": True},
    ),
    Case("alice", "/assignments/{assignment}/exceptions/", "css=[value=ungroup]", "Saved."),
    Case("alice", "/assignments/{assignment}/exceptions/", "css=[value=reference]", "Saved.", {"Label": "Ours"}),
    Case("alice", "/assignments/{assignment}/exceptions/", "css=[value=remove-reference]", "Saved."),
    Case("alice", "/assignments/{assignment}/parts/1/", "css=[value=save]", "Saved.", {"Points": "50"}),
    Case(
        "alice",
        "/assignments/{assignment}/regrade/",
        "css=[value=propose]",
        "Nothing has changed yet.",
        {"Reason": "Half"},
    ),
    Case("alice", "/assignments/{assignment}/regrade/", "css=[value=apply]", "Marks changed."),
    Case("alice", "/attempts/{attempt}/", "Give it back", "Given back.", {"Reason": "Wrong track"}),
    Case("alice", "/assignments/copy/7c/", "Copy", "Drafts created", {"Name of the new class": "7d"}),
    Case("alice", "/assignments/{task}/", "css=#send button", "Handed in."),
    Case(
        "admin",
        "/groups/lab/",
        "Delete all assignments",
        "There are marks that nobody has downloaded",
        {"Type the name of the group to confirm": "Lab"},
    ),
    Case(
        "alice",
        "/classes/7c/",
        "Take out and delete",
        "Ben Park is out of the class.",
        {"Ben Park": True, "css=#sure": True},
    ),
    Case("alice", "/classes/7c/", "Delete everything", "Class deleted", {"Type the class name to confirm": "7c"}),
    Case("guest", "/class/", "css=form button", "Unknown code.", {"Code on your card": "ABCD"}),
    Case("guest", "/class/ABCDEFGHJKMN/", "css=form button", "Unknown code."),
    # teams
    Case("admin", "/teams/new/", "Found the team", "The team is founded.", {"Name": "Kites"}),
    Case("alice", "/teams/comets/", "Ask to join", "Saved.", {"Alias": "slowpoke"}),
    Case("alice", "/teams/comets/", "css=#invite li:has-text('slowpoke') button", "Saved."),
    Case("newcomer", "/teams/comets/", "Decline", "Saved."),
    Case("newcomer", "/teams/", "css=form[action='/teams/rockets/'] [value=decline]", "Saved."),
    Case("newcomer", "/teams/", "css=form[action='/teams/rebels/'] [value=accept]", "Saved."),
    Case("newcomer", "/teams/rebels/", "Leave the team", "You have left the team."),
    Case("newcomer", "/teams/join/{team_code}/", "Join the team", "You are in the team."),
    Case("newcomer", "/teams/comets/", "Leave the team", "You have left the team."),
    Case("newcomer", "/teams/aces/", "Join", "Saved."),
    Case("alice", "/teams/comets/", "css=#members [value=remove]", "Saved."),
    Case("alice", "/teams/comets/", "css=#members [value=hand_over]", "Saved."),
    Case("admin", "/teams/comets/", "css=.side [value=link]", "Saved."),
    # groups
    Case("alice", "/groups/new/", "Create the group", "Group created.", {"Name": "Owls"}),
    Case("newcomer", "/groups/join/{group_code}/", "Request to join", "waits for its leader"),
    Case("alice", "/groups/club/", "Confirm", "Saved."),
    Case("alice", "/groups/club/", "css=.side [value=link]", "Saved."),
    Case("alice", "/groups/club/", "css=.side [value=change]", "Saved.", {"Name": "Club of owls"}),
    Case("alice", "/groups/club/", "css=#members [value=hand_over]", "Saved."),
    Case("newcomer", "/groups/club/", "Leave the group", "You are no longer in the group."),
    Case("admin", "/groups/club/", "css=#members [value=remove]", "Saved."),
    Case("admin", "/groups/club/", "Decline", "Saved."),
    Case("admin", "/groups/club/", "Delete the group", "Group deleted."),
    # invitations by e-mail
    Case(
        "alice", "/races/secret-race/invited/", "Preview", "css=#preview", {"css=[name=addresses]": "b@x.org, nobody"}
    ),
    Case(
        "alice",
        "/races/secret-race/invited/",
        "Invite them",
        "1 address is invited.",
        {"css=[name=addresses]": "b@x.org"},
    ),
    Case("alice", "/races/secret-race/invited/", "css=[name=again]", "New invitation sent"),
    Case("alice", "/races/secret-race/invited/", "css=[name=withdraw]", "Invitation withdrawn."),
    Case("guest", "/races/invited/{invited}/", "Log in and join", "css=input[name=login]"),
    Case("guest", "/races/invited/{invited}/", "Sign up and join", "css=input[name=password2]"),
    Case("newcomer", "/races/invited/{invited}/", "Join the race", "You have joined."),
    Case("guest", "/invitations/stop/{invited_stop}/", "Stop them", "css=main:not(:has(form))"),
    # races
    Case("admin", "/races/next-race/", "Enter", "You have joined."),
    Case("newcomer", "/races/open-race/", "Submit", "css=#live-card"),
    Case("newcomer", "/races/open-race/withdraw/", "Withdraw", "You have withdrawn."),
    Case("newcomer", "/races/new/?track=oval", "Create the race", "Race created.", {"Name": "Lunch"}),
    Case("alice", "/races/later-race/edit/", "Save", "Saved.", {"Name": "Later still"}),
    Case("alice", "/races/secret-race/edit/", "Replace this link", "New link created"),
    Case(
        "alice",
        "/races/secret-race/edit/",
        "css=#spectators form button",
        "The spectators' link is new.",
    ),
    Case("alice", "/races/open-race/racers/", "css=[action$='gone/restore/'] button", "gone is back in the race."),
    Case("alice", "/races/open-race/racers/slowpoke/remove/", "Remove", "slowpoke is removed", {"Reason": "Rude"}),
    # real cars
    Case(
        "alice",
        "/races/real-race/timing/set-up/",
        "Name a timekeeper",
        "is now a timekeeper.",
        {"Alias of the timekeeper": "newcomer"},
    ),
    Case("alice", "", "Dismiss newcomer", "newcomer is no longer a timekeeper."),
    Case("alice", "", "Make a sensor", "Copy it now", {"Name of the sensor": "Strip"}),
    Case("alice", "/races/real-race/timing/set-up/", "Revoke Old gate", "Token revoked."),
    Case("alice", "", "Give Tom Guest", "now belong to gone.", {"Alias of Tom Guest": "gone"}),
    Case("alice", "", "Take the laps", "1 lap imported.", {"CSV file": [LAPS]}),
    Case(
        "alice",
        "/races/real-race/laps/{timed_lap}/correct/",
        "Correct the lap",
        "Lap corrected.",
        {"Time": "0:10.500", "Reason": "Seen on the film"},
    ),
    Case("newcomer", "/races/real-race/laps/", "Enter", "You have joined."),
    Case("newcomer", "/laps/{claim}/", "Yes, they are mine", "You have taken over these laps."),
    Case("newcomer", "/races/real-race/", "css=#car button", "Saved.", {"Model on the car": "Spark"}),
    Case("newcomer", "/races/real-race/laps/", "css=#car button", "Saved.", {"Model on the car": "Spark"}),
    Case("newcomer", "/spoilers/", "Hide results from now on", "Results are hidden since"),
    Case("newcomer", "/races/open-race/", "css=#board .spoiler-offer button", "css=#board .card-head"),
    Case("newcomer", "/spoilers/", "Show all results", "Results are visible."),
    Case("alice", "/races/rain-race/cancel/", "Cancel the race", "Race cancelled.", {"Reason": "Rain"}),
    Case("alice", "/races/secret-race/close/", "Close now", "Race closed."),
    Case("alice", "/races/duel-race/duels/", "Draw now", "Duels drawn."),
    Case("alice", "/races/open-race/event/plan/", "Save", "The live event is planned."),
    Case("alice", "/races/open-race/event/", "Drive with it", "css=#live-side option[selected]"),
    Case("alice", LIVE, "Show it", "css=#live-say[value=Welcome]", {"Message": "Welcome"}),
    Case("alice", LIVE, "Close the choice", "css=#act-models[value=open]"),
    Case("alice", LIVE, "Open the choice", "css=#act-models[value=close]"),
    Case("alice", LIVE, "Run automatically", "css=#act-auto[value=manual]"),
    Case("alice", LIVE, "Run manually", "css=#act-auto[value=auto]"),
    Case("alice", LIVE, "Cancel the event", _logged("cancel")),
    Case("alice", LIVE, "Undo", _logged("undo")),
    Case("alice", LIVE, "Begin", "css=.console-order"),
    Case("alice", LIVE, "css=#act-launch", "This racer has no model"),
    Case("alice", LIVE, "Pause", "css=#act-resume"),
    Case("alice", LIVE, "Continue", "css=#act-pause"),
    Case("alice", LIVE, "css=[value=down]", _logged("move")),
    Case("alice", LIVE, "css=[value=call]", "css=.console-slot.called"),
    Case("alice", LIVE, "css=[value=up]", _logged("move")),
    Case("alice", LIVE, "css=[value=hold]", "css=.console-slot.held"),
    Case("alice", LIVE, "css=[value=release]", _logged("release")),
    Case("alice", LIVE, "css=[value=skip]", "css=.console-slot.skipped"),
    Case("alice", LIVE, "css=[value=again]", "attempt 2"),
    Case("alice", LIVE, "css=[value=remove]", "css=.console-slot.removed"),
    Case("alice", LIVE, "css=[value=add]", _logged("add")),
    Case("alice", LIVE, "Has won", _logged("winner")),
    Case("alice", LIVE, "Show the podium", _logged("podium")),
    Case("alice", LIVE, "End the event", _logged("end")),
    # the garage
    Case("newcomer", "/models/upload/", "Upload", "The model is in your garage.", {"css=[type=file]": A_CAR}),
    Case("newcomer", "/tracks/import/", "Import", "Track imported.", {"Name": "Ours", "Track file": A_TRACK}),
    Case("alice", "/models/{model}/", "Share with all racers", "Model shared"),
    Case("alice", "/models/{shared}/", "Stop sharing", "The model is no longer shared."),
    Case("alice", "/models/{shared}/delete/", "Delete", "Model deleted."),
    Case("admin", "/models/{theirs}/", "Stop sharing (as an admin)", "The model is no longer shared."),
    Case("alice", "/models/{spare}/", "css=form[action$='/submit/'] button", "css=#live-card"),
    Case("alice", "/models/{model}/edit/", "Save", "Saved.", {"Name": "Lightning 2"}),
    Case("alice", "/models/shared/", "Search", "No matching models or racers", {"Name or racer": "nobody"}),
    Case(
        "alice",
        "/models/",
        "Show",
        "No matching models",
        {"Name, description or algorithm": "zebra"},
    ),
    Case("guest", "/guides/", "Search", "css=.found", {"Search the guides": "penalty"}),
    Case("guest", "/guides/tracks/", "Search", "css=.found", {"Search the guides": "penalty"}),
    Case("guest", "/tracks/", "Show", "No matching tracks", {"Name of a track": "nowhere"}),
    Case("alice", "/vehicles/new/", "Save", "Saved.", {"Name": "Second"}),
    Case("alice", "/vehicles/{vehicle}/", "Save", "Saved.", {"Name": "Third"}),
    Case("alice", "/vehicles/{vehicle}/delete/", "Delete", "Vehicle deleted."),
    # training
    Case("alice", "/train/new/", "Create and train", "Training queued.", {"Name": "Made-here"}),
    Case(
        "alice",
        "/train/new/",
        "Regenerate table",
        "css=[name=actions-7-speed]:not([value=''])",
        {"Steering angles": "7"},
        scripts=False,
    ),
    Case(
        "alice",
        "/train/new/?action_space_type=continuous",
        "Full range",
        "css=[name=speed_high][value^='4']",
        scripts=False,
    ),
    Case("alice", "", "Default ranges", "css=[name=speed_high][value^='2']", scripts=False),
    Case("alice", "/train/new/", "Use AWS console defaults", "css=[name=num_epochs][value='10']", scripts=False),
    Case("alice", "", "Use Paddock defaults", "css=[name=num_epochs][value='4']", scripts=False),
    Case("alice", "/train/new/", "Validate", "No problems found", scripts=False),
    Case("alice", "/train/new/", "Does it pay to drive fast?", "css=.audit-table", scripts=False),
    Case("alice", "/train/{job}/", "Stop the training", "Training stopped before it started."),
    Case("alice", "/train/{ended}/", "Evaluate: three laps", "css=#evaluation"),
    Case("alice", "/train/{ended}/", "css=form[action$='/submit/'] button", "css=#board"),
    Case("alice", "/train/{ended}/delete/", "Delete", "Training deleted:"),
    Case("alice", "/train/sweeps/{sweep}/", "Stop the sweep", "Stopping. The best setting so far becomes a model."),
    Case("alice", "/train/sweeps/{swept}/delete/", "Delete", "Sweep deleted. Its models stay."),
    Case(
        "alice",
        "/train/new/",
        "Try these settings",
        "css=#trials",
        {"Name": "Tuned", "css=[name=sweep-vary][value=lr]": True},
    ),
    Case("alice", "/learn/laboratory/", "Show on the track", "css=#maps svg"),
    Case("alice", "/learn/laboratory/", "Validate", "No problems found", scripts=False),
    Case("alice", "/learn/laboratory/", "Does it pay to drive fast?", "css=.audit-table", scripts=False),
    # runs
    Case("alice", "/evaluations/{queued}/", "Stop", "css=.pill.cancelled, .pill.stopped"),
    Case("alice", "/evaluations/{driven}/?video={waits}", "Stop", "css=#video:not(:has(progress))", inside="#video"),
    Case("alice", "/evaluations/{driven}/", "css=.video-ask button", "css=#video progress, #video .live-line"),
    Case("alice", "/runs/new/?race=open-race", "Drive", "css=#live", {"Model": "Spare"}),
    Case("alice", "/runs/new/", "Use its rules", "css=[name=submit_if_better]"),
    Case("alice", "/runs/new/?track=oval", "Drive", "css=#live", {"Model": "Spare"}),
    Case("alice", "/evaluations/{own}/", "Run again", "css=#live"),
    Case(
        "alice",
        "/evaluations/{driven}/replay/",
        "Add",
        "css=select[name=with]",
        {"Any other, by its link": "/evaluations/{chased}/"},
    ),
    Case(
        "alice",
        "/evaluations/{driven}/replay/?with={chased}&lap=1",
        "Compare",
        "css=[name=lap] option[value='2'][selected]",
        {"css=[name=lap]": "2"},
    ),
    # reports
    Case("alice", "/models/{spare}/", "Drive a report", "css=#live"),
    Case("alice", "/reports/new/", "Drive", "css=#live", {"Model": "Spare"}),
    Case("alice", "/reports/{report}/", "Compare", "css=#compare table", scripts=False),
    Case("alice", "/reports/{report}/", "Drive again", "css=#live"),
    Case("alice", "/reports/{report_waits}/", "Stop", "css=.pill.stopped"),
    Case("alice", "/reports/", STOP, f"css=main:not(:has({STOP.removeprefix('css=')}))"),
    Case("alice", "/reports/", "css=form[action$='/{report}/again/'] button", "css=#live"),
    Case("alice", "/reports/{report}/delete/", "Delete", "Report deleted."),
    Case("alice", "/evaluations/{own}/delete/", "Delete", "Run deleted."),
    Case("alice", "/runs/", "Show", "css=[name=state] option[value=queued][selected]", {"State": "queued"}),
    Case("alice", "/runs/", "Stop", "css=#evaluation .pill.stopped"),
    Case("alice", "/runs/", "Run again", "css=#live"),
    # seasons and stewards
    Case(
        "guest",
        "/seasons/2027/calendar/",
        "Show",
        "css=option[value='Asia/Seoul'][selected]",
        {"Time zone": "Asia/Seoul"},
    ),
    Case(
        "admin", "/admin/races/race/", "Search", "css=#searchbar[value=Open]", {"css=#searchbar": "Open"}, inside="body"
    ),
    Case(
        "admin", "/workers/evaluations/failed/", "Filter", "css=option[value='0'][selected]", {"Ended within": "ever"}
    ),
    Case("admin", "", "Run all of them again", "css=.messages li, .messages p"),
    Case(
        "admin",
        "/programs/",
        "Create the program",
        "Program created.",
        {"Name": "ci", "Purpose": "Results", "Owner": "alice"},
    ),
    Case("admin", "", "Create a token", "css=input[type=password]"),
    Case("admin", "", "Continue", "css=#new-token", {"Password": PASSWORD}),
    Case("admin", "", "Disable", "css=[value=enable]"),  # at the address of the question for the password
    Case("admin", "", "Enable", "css=[value=disable]"),
    Case("admin", "", "Replace", "css=#new-token"),
    Case("admin", "/programs/program-ci/", "Revoke", "css=main:not(:has([value=revoke]))"),
    Case("admin", "/audit/", "Filter", "css=#id_target[value=oval]", {"css=#id_target": "oval"}),
    Case("alice", "/races/open-race/audit/", "Filter", "css=#id_target[value=oval]", {"css=#id_target": "oval"}),
    Case("admin", "/seasons/new/", "css=.actions [value=preview]", CHANGE, {"Name": "Next", "Address": "next"}),
    Case("admin", "", CHANGE, "css=[value=pattern]"),
    Case("admin", "", "Same as the pattern", CHANGE),
    Case("admin", "", CHANGE, "css=[value=pattern]"),
    Case("admin", "", "Back to the season", CHANGE),
    Case("admin", "", CHANGE, "css=[value=pattern]"),
    Case("admin", "", "css=.actions [value=keep]", CHANGE),
    Case("admin", "", "Create the season", "Season created"),
    Case("admin", "/races/round-3/", "Announce", "Everyone in the race gets a notice", inside=STEWARD),
    Case("admin", "/races/round-3/", "Postpone", "The race closes later", inside=STEWARD),
    Case("admin", "/races/round-3/", "Disqualify", "The racer is removed from the board", inside=STEWARD),
    Case("admin", "", "Find", "css=#find[value=bob]", {"css=#find": "bob"}, inside="body"),
    Case("admin", "/races/round-3/", "Reinstate", "The racer returns to the board", inside=STEWARD),
    Case("admin", "/races/round-1/", "Lock results", "This cannot be undone", inside=STEWARD),
    Case("admin", "/races/round-2/", "Revoke results", "are withdrawn until the results", inside=STEWARD),
    Case("admin", "", "Preview", "css=button[value=confirmed]", {"Reason": "Sure"}, inside="body"),
    Case("admin", "", "Revoke results", "css=#stewards", inside="body"),
    Case("admin", "/races/round-2/", "Publish results", "css=button[value=confirmed]", inside=STEWARD),
    Case("admin", "/seasons/2027/", "Do not continue", "The season ends without a successor."),
    Case("admin", "", "Continue automatically", "The season continues automatically"),
    Case(
        "admin",
        "/seasons/2027/copy/",
        "Copy this season",
        "Season copied: 3 races.",
        {"css=[name=name]": "Copy", "css=[name=slug]": "copy"},
    ),
    Case("admin", "/seasons/copy/delete/", "css=[name=round]", "is deleted."),
    Case("admin", "/seasons/copy/delete/", "Delete the season", "is deleted."),
    # in a window of its own: the admin of the other cases stays logged in
    Case("admin", "/admin/", "Log out", "Race the car you trained", inside="#header", scripts=False),
]
