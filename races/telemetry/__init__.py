"""Telemetry of runs: laps side by side along their way, mini-sectors, and where time was lost."""
