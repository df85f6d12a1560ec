"""Every write to races, entries, submissions and standings.

Rows are always locked in the order evaluation, entry, race, so that no two writers wait for each other: whoever holds
an entry or a race and wants an evaluation stopped does so after the commit.
"""

from ..layout import race_rules
from .duels import draw_duels, drive_all_on, drive_on, record_ended_duel
from .entries import accept_invitation, enter_race, give_field, remove_entry, restore_entry, take_out, withdraw
from .own import delete_own, drive_own, drive_own_again, record_ended_own
from .races import (
    cancel_race,
    clone_race,
    close_race,
    create_community_race,
    create_league_race,
    edit_race,
    renew_spectator_link,
    reset_invitation,
)
from .standings import recompute_race, recompute_standing, record_ended_evaluation
from .submissions import repeat_submission, submit_model

__all__ = [
    "accept_invitation",
    "cancel_race",
    "clone_race",
    "close_race",
    "create_community_race",
    "create_league_race",
    "delete_own",
    "draw_duels",
    "drive_all_on",
    "drive_on",
    "drive_own",
    "drive_own_again",
    "edit_race",
    "enter_race",
    "give_field",
    "race_rules",
    "recompute_race",
    "recompute_standing",
    "record_ended_duel",
    "record_ended_evaluation",
    "record_ended_own",
    "remove_entry",
    "renew_spectator_link",
    "repeat_submission",
    "reset_invitation",
    "restore_entry",
    "submit_model",
    "take_out",
    "withdraw",
]
