"""House cars: baselines on boards, and the organiser of the demo races."""
