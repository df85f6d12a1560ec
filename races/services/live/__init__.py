"""Every write to live events. Rows are locked in the order event, evaluation, entries, race.

What an organiser does takes ``by`` and ``seen``, the version of the event that they saw: of two who do the same at
once, the second is refused with ``live_changed`` and looks again. What the clock does has no ``by``.
"""

from .clock import tick_live
from .order import call_slot, hold_slot, move_slot, release_slot, remove_slot, run_again, skip_slot
from .planning import cancel_live, change_live, plan_live, set_auto_run, set_submissions
from .reacting import react
from .roll import add_late, choose_model, say_here
from .sealing import prepare_ahead
from .show import begin_live, crown, end_live, launch, pause_live, resume_live, say_to_spectators, show_podium
from .speed import command_now, command_start, name_deputy
from .undo import undo_last

__all__ = [
    "add_late",
    "begin_live",
    "call_slot",
    "cancel_live",
    "change_live",
    "choose_model",
    "command_now",
    "command_start",
    "crown",
    "end_live",
    "hold_slot",
    "launch",
    "move_slot",
    "name_deputy",
    "pause_live",
    "plan_live",
    "prepare_ahead",
    "react",
    "release_slot",
    "remove_slot",
    "resume_live",
    "run_again",
    "say_here",
    "say_to_spectators",
    "set_auto_run",
    "set_submissions",
    "show_podium",
    "skip_slot",
    "tick_live",
    "undo_last",
]
