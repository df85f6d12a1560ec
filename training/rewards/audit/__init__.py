"""The audit of a reward function: whether it pays for driving fast, asked on eight recorded drives."""
