"""Every write to races of real cars: sessions, laps, guests, timekeepers, sensors, corrections."""

from .corrections import correct_lap
from .files import read_laps, take_file
from .guests import claim_guest, link_guest
from .laps import SentLap
from .people import choose_car, dismiss_timekeeper, name_timekeeper
from .sensors import make_sensor, revoke_sensor, sensor_with, take_crossing
from .sessions import SentSession, carry_over

__all__ = [
    "SentLap",
    "SentSession",
    "carry_over",
    "choose_car",
    "claim_guest",
    "correct_lap",
    "dismiss_timekeeper",
    "link_guest",
    "make_sensor",
    "name_timekeeper",
    "read_laps",
    "revoke_sensor",
    "sensor_with",
    "take_crossing",
    "take_file",
]
