"""The kinds of events of the league. They are visible to everybody with access to the race: results are public."""

from core.events import EventKind, register
from core.events.visibility import OWN
from races.events import RACE

_KEYS = ("racer", "race", "subject")

# subject: the season's address
PROMOTED = register(EventKind("racer.promoted", "a racer is promoted by a round", RACE, _KEYS, ("round",)))
IN_FINALE = register(EventKind("racer.finale", "a racer reached a finale by a round", RACE, _KEYS, ("round",)))
QUALIFIED = register(
    EventKind("racer.qualified", "a racer has qualified for the championship by a round", RACE, _KEYS, ("round",))
)
# subject: the number of the stewards' decision
DISQUALIFIED = register(EventKind("racer.disqualified", "stewards have disqualified a racer", RACE, _KEYS, ("reason",)))
RESTORED = register(EventKind("racer.restored", "stewards have put a racer back", RACE, _KEYS, ("reason",)))
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
