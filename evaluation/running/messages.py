"""The parts of the referee's messages that are stored as they come, as JSON carries them."""

from typing import NotRequired, TypedDict

from paddock.simulator.results import LapDocument


class FaultDocument(TypedDict):
    """A fault: its reason code and the values of its sentence."""

    code: str
    params: dict[str, str | int | float]
    fault: NotRequired[str]


class DrivenLapDocument(LapDocument):
    """One lap; times in whole simulated milliseconds."""
