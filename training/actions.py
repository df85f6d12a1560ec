"""Tables of actions as the wizard makes them from granularities. No Django."""

from __future__ import annotations

from .hyperparameters import SPEED_MPS

# The console's 3, 5 or 7 steering angles and 1 to 3 speeds, and a few more: no more than 30 actions in all.
STEERING_GRANULARITIES = (2, 3, 5, 7, 9)
SPEED_GRANULARITIES = (1, 2, 3)


def discrete_actions(
    max_steering_deg: float, steerings: int, max_speed_mps: float, speeds: int
) -> list[dict[str, float]]:
    """The table of actions: ``steerings`` angles spread evenly over both sides, each with ``speeds`` even shares of the
    greatest speed (so the console did it), right to left, slow to fast."""
    angles = [-max_steering_deg + 2 * max_steering_deg * i / (steerings - 1) for i in range(steerings)]
    return [
        {"steering_angle": round(angle, 2) + 0.0, "speed": max(SPEED_MPS[0], round(max_speed_mps * k / speeds, 2))}
        for angle in angles
        for k in range(1, speeds + 1)
    ]
