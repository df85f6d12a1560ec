"""Every write to live events. Rows are locked in the order event, evaluation, entries, race.

An organiser's act takes ``by`` and ``seen``, the version of the event on the page; on a newer version it raises
``live_changed``. Acts of the clock have no ``by``.
"""

from .clock import tick_live
from .event_action import undo_last
from .order import call_slot, hold_slot, move_slot, release_slot, remove_slot, run_again, skip_slot
from .planning import cancel_live, change_live, plan_live, set_auto_run, set_submissions
from .roll_call import add_late, check_in, choose_model
from .sealing import prepare_ahead
from .show import (
    begin_live,
    crown,
    end_live,
    launch,
    pause_live,
    react,
    resume_live,
    set_message,
    show_podium,
)
from .speed import command_now, command_start, name_deputy
