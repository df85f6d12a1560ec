"""The size of rewards as PPO learns from them.

A reward function may pay 0.01 or 100 for a good step. PPO's policy and its value share their eyes, so with great
rewards the value's errors are most of what these learn from, and a car that stands before a bend which it cannot take
stays there. So rewards are multiplied by what makes a lasting mean reward worth :data:`WORTH`. SAC weighs rewards
against what it pays for being undecided, which is its owner's choice, and gets them as they are.
"""

from __future__ import annotations

from typing import Any

import numpy as np

WORTH = 3.0
_LEAST_SHARE = 0.01  # of what is to come that one step counts, where the discount factor is 1 or nearly


class RewardScale:
    """Learns how great rewards are from all that were paid."""

    def __init__(self, discount: float) -> None:
        self._share = max(1.0 - discount, _LEAST_SHARE)
        self._paid, self._steps = 0.0, 0

    @property
    def factor(self) -> float:
        """What rewards are multiplied by now: 1 as long as nothing was paid."""
        return WORTH * self._share * self._steps / self._paid if self._paid else 1.0

    def scaled(self, rewards: np.ndarray) -> np.ndarray:
        """The rewards of one step of all cars, float32, as they are learned from."""
        self._paid += float(np.abs(rewards, dtype=np.float64).sum())
        self._steps += len(rewards)
        return (rewards * self.factor).astype(np.float32)

    def state(self) -> dict[str, Any]:
        """Plain numbers for a checkpoint."""
        return {"paid": self._paid, "steps": self._steps}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from :meth:`state`."""
        self._paid, self._steps = float(state["paid"]), int(state["steps"])
