"""What happens to accounts, as events."""

from __future__ import annotations

from core.events import EventKind, register
from core.events.visibility import OWN

TEAM_INVITED = register(EventKind("team.invited", "a racer is asked to join a team", OWN, ("racer", "subject")))
