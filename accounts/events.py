"""What happens to accounts, as events."""

from core.events import EventKind, register
from core.events.visibility import OWN

TEAM_INVITED = register(EventKind("team.invited", "a racer is invited to a team", OWN, ("racer", "subject")))
