"""Races of real cars: sessions and laps, sensors, timekeepers, guests."""

from .desk import TimingView
from .guests import ClaimView, GuestsView, GuestView
from .laps import LapFileView, LapView
from .people import TimekeepersView, TimekeeperView
from .sensors import CrossingsView, SensorsView, SensorView
from .sessions import SessionsView, SessionView

__all__ = [
    "ClaimView",
    "CrossingsView",
    "GuestView",
    "GuestsView",
    "LapFileView",
    "LapView",
    "SensorView",
    "SensorsView",
    "SessionView",
    "SessionsView",
    "TimekeeperView",
    "TimekeepersView",
    "TimingView",
]
