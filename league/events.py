"""What happens in the league, as events. Everybody who may see the race may see them: results are public."""

from __future__ import annotations

from core.events import EventKind, register
from core.events.visibility import OWN
from races.events import RACE

_WHO = ("racer", "race", "subject")

# subject: the season's address
PROMOTED = register(EventKind("racer.promoted", "a racer is promoted by a round", RACE, _WHO, ("round",)))
IN_FINALE = register(EventKind("racer.finale", "a racer is in a finale by a round", RACE, _WHO, ("round",)))
QUALIFIED = register(
    EventKind("racer.qualified", "a racer has qualified for the championship by a round", RACE, _WHO, ("round",))
)
# subject: the number of the stewards' decision
DISQUALIFIED = register(EventKind("racer.disqualified", "stewards have disqualified a racer", RACE, _WHO, ("reason",)))
RESTORED = register(EventKind("racer.restored", "stewards have put a racer back", RACE, _WHO, ("reason",)))
# subject: the address of the new season
SEASON_DRAFTED = register(
    EventKind(
        "season.drafted",
        "the season that follows another one is drafted",
        OWN,
        ("subject",),
        ("opens", "before", "left_out"),
        once="drafted season",
    )
)
# subject: its day
CUP_OVER = register(
    EventKind("cup.over", "a cup of the day has its winners", RACE, ("race", "subject"), ("cars",), once="day")
)
