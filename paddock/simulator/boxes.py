"""Tracks one car past the boxes of a layout: passes, collisions and resets near a box."""

import math

from .car import Pose
from .layout import Layout, other_lane
from .solids import BOX_NEAR_M2, hits_box, overlaps_box

# deepracer-simapp, agent_ctrl/constants.py: CLOSEST_OBJ_GAP, RESET_BEHIND_DIST, RESET_AHEAD_DIST.
NEAR_M = BEHIND_M = AHEAD_M = 1.0
PASSED_M = 0.2  # a nose this far beyond a box's middle is past the box
BEYOND_M = 0.5  # a car this far behind a box's middle stands clear of it


class BoxWatch:
    """Follows one car's progress past the boxes in unwrapped metres. ``floor_m``: the place behind the last passed box,
    before which the car is never put back."""

    def __init__(self, layout: Layout, length: float, mercy_resets: int, nose_m: float) -> None:
        """``length``: of the track; ``nose_m``: where the nose starts, unwrapped."""
        self._boxes = layout.boxes
        self._solids = tuple(box.solid for box in layout.boxes)
        self._length = length
        self._mercy_resets = mercy_resets
        self._resets_here = 0
        self._number = 0  # of the next box, counted on through all laps
        self.floor_m = -math.inf
        self.next_m = math.inf
        if self._boxes:
            self._number = math.floor(nose_m / length) * len(self._boxes)
            self.next_m = self._metres(self._number)
            self.moved(nose_m)
            self.floor_m = -math.inf

    def moved(self, nose_m: float) -> None:
        """The nose moved to ``nose_m`` and may have passed boxes."""
        while nose_m >= self.next_m + PASSED_M:
            self._pass()

    def hit(self, pose: Pose) -> bool:
        """True where the car at ``pose`` crashes into a box."""
        x, y, _ = pose
        for solid in self._solids:
            dx, dy = x - solid[0], y - solid[1]
            if dx * dx + dy * dy <= BOX_NEAR_M2 and hits_box(pose, solid):
                return True
        return False

    def free(self, pose: Pose) -> bool:
        """True where a car may be put at ``pose`` without standing in a box."""
        return not any(overlaps_box(pose, solid) for solid in self._solids)

    def put_back(self, metres: float, lane: str) -> tuple[float, str]:
        """The place of a reset at ``metres`` in ``lane``: 1 m before the next box, in the other lane, if that box is
        nearer than 1 m, and 1 m after it at the rules' ``mercy_resets``-th time."""
        metres = max(metres, self.floor_m)
        if self.next_m - metres >= NEAR_M:
            return metres, lane
        self._resets_here += 1
        if self._resets_here == self._mercy_resets:
            metres = self.next_m + AHEAD_M
            self._pass()
            if self.next_m - metres >= NEAR_M:
                return metres, lane
        return max(self.next_m - BEHIND_M, self.floor_m), other_lane(self._lane(self._number))

    def _pass(self) -> None:
        self.floor_m = self.next_m + BEYOND_M
        self._resets_here = 0
        self._number += 1
        self.next_m = self._metres(self._number)

    def _metres(self, number: int) -> float:
        lap, index = divmod(number, len(self._boxes))
        return lap * self._length + self._boxes[index].metres

    def _lane(self, number: int) -> str:
        return self._boxes[number % len(self._boxes)].lane
