"""What a run shows: turns, telemetry, mini-sectors and lost time, from a sim-trace and its track."""
