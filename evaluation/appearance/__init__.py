"""The look of a vehicle on pages and in replays: its shell and colour."""
