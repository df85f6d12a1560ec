"""The kinds of events of the league."""

from core.events import EventKind, register

_KEYS = ("racer", "race", "subject")

# subject: the season's address
PROMOTED = register(EventKind("racer.promoted", "a racer is promoted by a round", _KEYS, ("round",)))
IN_FINALE = register(EventKind("racer.finale", "a racer reached a finale by a round", _KEYS, ("round",)))
QUALIFIED = register(
    EventKind("racer.qualified", "a racer has qualified for the championship by a round", _KEYS, ("round",))
)
# subject: the number of the stewards' decision
DISQUALIFIED = register(EventKind("racer.disqualified", "stewards have disqualified a racer", _KEYS, ("reason",)))
RESTORED = register(EventKind("racer.restored", "stewards have put a racer back", _KEYS, ("reason",)))
# subject: the address of the new season
SEASON_DRAFTED = register(
    EventKind(
        "season.drafted",
        "the season that follows another one is drafted",
        ("subject",),
        ("opens", "before", "left_out"),
        once="drafted season",
    )
)
# subject: its day
CUP_OVER = register(
    EventKind("cup.over", "a cup of the day has its winners", ("race", "subject"), ("cars",), once="day")
)
