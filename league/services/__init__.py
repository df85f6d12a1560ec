"""Every write to seasons, rounds, divisions and house cars."""

from .demo import open_demo_season
from .house import HouseReport, enter_house_cars, house_cars, house_racer
from .seasons import create_season, put_in_division, schedule_round

__all__ = [
    "HouseReport",
    "create_season",
    "enter_house_cars",
    "house_cars",
    "house_racer",
    "open_demo_season",
    "put_in_division",
    "schedule_round",
]
