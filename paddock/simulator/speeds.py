"""What racers command of their cars' speeds during a run, put between the network's answer and the car."""

from __future__ import annotations

from collections.abc import Sequence

from paddock.rules.speed import SpeedCommand

from .action import Action


class CommandedSpeeds:
    """The log of one car's commands, followed as its clock goes on."""

    def __init__(self, commands: Sequence[SpeedCommand]) -> None:
        self._coming = list(reversed(commands))
        self._now: SpeedCommand | None = None

    def __call__(self, action: Action, time_ms: int) -> Action:
        """The command at ``time_ms`` of the run: the steering is the model's, the speed what its racer makes of it."""
        while self._coming and self._coming[-1].at_ms <= time_ms:
            self._now = self._coming.pop()
        return action if self._now is None else action._replace(speed_mps=self._now.speed_of(action.speed_mps))


def commanded_speeds(commands: Sequence[SpeedCommand], cars: int) -> dict[int, CommandedSpeeds]:
    """Of each car that has commands the one who follows them. Raises ValueError for a car that there is not."""
    if any(one.car >= cars for one in commands):
        raise ValueError(f"speed_commands name car {max(one.car for one in commands)}, and there are {cars}")
    return {
        number: CommandedSpeeds([one for one in commands if one.car == number])
        for number in sorted({one.car for one in commands})
    }
