"""What happens to accounts, as events."""

from core.events import EventKind, register

TEAM_INVITED = register(EventKind("team.invited", "a racer is invited to a team", ("racer", "subject")))
