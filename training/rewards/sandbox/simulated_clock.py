"""Simulated ``time`` and ``datetime`` of a reward function: ``params["sim_time"]`` of the call; trainings repeat.

Each car has its own clock; at the top level, before the first call, it stands at 0.
"""

import datetime as real_datetime
import time as real_time
from collections.abc import Callable
from types import ModuleType
from typing import Any

CLOCKS = ("time", "datetime")
_READ = ("time", "monotonic", "perf_counter", "process_time", "thread_time")
_KEPT = ("struct_time", "mktime", "strptime", "tzname", "timezone", "altzone", "daylight")


class EpisodeClock:
    def __init__(self) -> None:
        self.now = 0.0
        self._made: dict[str, ModuleType] = {}

    def module(self, name: str) -> ModuleType:
        if name not in self._made:
            self._made[name] = _time(self) if name == "time" else _datetime(self)
        return self._made[name]


PRESENT = EpisodeClock()  # the clock of the present call, for the standard library's own modules


def _time(clock: EpisodeClock) -> ModuleType:
    made: Any = ModuleType("time", "Simulated seconds of the episode; sleep() does not wait.")
    for name in _READ:
        setattr(made, name, lambda: clock.now)
        setattr(made, f"{name}_ns", lambda: round(1e9 * clock.now))
    for name in _KEPT:
        setattr(made, name, getattr(real_time, name))

    def at(convert: Callable[[float], Any]) -> Callable[..., Any]:
        return lambda seconds=None: convert(clock.now if seconds is None else seconds)

    def moment(when: Any) -> Any:
        return real_time.gmtime(clock.now) if when is None else when

    made.gmtime, made.localtime = at(real_time.gmtime), at(real_time.gmtime)
    made.ctime = at(lambda seconds: real_time.asctime(real_time.gmtime(seconds)))
    made.asctime = lambda when=None: real_time.asctime(moment(when))
    made.strftime = lambda text, when=None: real_time.strftime(text, moment(when))
    made.sleep = lambda _seconds: None
    return made


def _datetime(clock: EpisodeClock) -> ModuleType:
    utc = real_datetime.UTC

    class AnyDate(type):
        """Of a date and a moment: those of the real module are instances, too."""

        def __instancecheck__(cls, instance: object) -> bool:
            return isinstance(instance, cls.__bases__[0])

        def __subclasscheck__(cls, other: type) -> bool:
            return issubclass(other, cls.__bases__[0])

    class Date(real_datetime.date, metaclass=AnyDate):
        @classmethod
        def today(cls) -> Any:
            return cls(*real_time.gmtime(clock.now)[:3])

    class DateTime(real_datetime.datetime, metaclass=AnyDate):
        @classmethod
        def now(cls, tz: Any = None) -> Any:
            moment = cls.fromtimestamp(clock.now, tz or utc)
            return moment if tz is not None else moment.replace(tzinfo=None)

        @classmethod
        def utcnow(cls) -> Any:
            return cls.now()

        today = utcnow

    made: Any = ModuleType("datetime", "As Python's, but today() and now() are those of the simulated clock.")
    for name in ("timedelta", "timezone", "tzinfo", "MINYEAR", "MAXYEAR", "UTC"):
        setattr(made, name, getattr(real_datetime, name))
    made.time = real_datetime.time
    for name, kind in (("date", Date), ("datetime", DateTime)):
        kind.__name__ = kind.__qualname__ = name
        setattr(made, name, kind)
    return made
