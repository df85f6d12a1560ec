"""Every write to races of real cars: sessions, laps, guests, timekeepers, sensors, corrections."""

from .checks import SentLap
from .files import read_laps, take_file
from .guests import claim_guest, link_guest
from .sensors import make_sensor, revoke_sensor, sensor_with, take_crossing
from .sessions import SentSession, carry_over, correct_lap
from .timekeepers import choose_car, dismiss_timekeeper, name_timekeeper
