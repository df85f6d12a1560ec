"""Every write to seasons, rounds, divisions and house cars."""

from .closing import close_due_rounds, close_round
from .demo import open_demo_season
from .house import HouseReport, enter_house_cars, house_cars, house_racer
from .ratings import rate_season
from .seasons import create_season, edit_season, put_in_division, schedule_round, set_stage_rules
from .stewards import disqualify, put_back, reopen_round

__all__ = [
    "HouseReport",
    "close_due_rounds",
    "close_round",
    "create_season",
    "disqualify",
    "edit_season",
    "enter_house_cars",
    "house_cars",
    "house_racer",
    "open_demo_season",
    "put_back",
    "put_in_division",
    "rate_season",
    "reopen_round",
    "schedule_round",
    "set_stage_rules",
]
