"""Pages of live events: the lobby and show, screens, speed commands."""
