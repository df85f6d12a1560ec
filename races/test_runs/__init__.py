"""Test runs: private evaluations of a racer that count in no race."""
