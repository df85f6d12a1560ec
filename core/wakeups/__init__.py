"""Messages to workers and stream processes that say "there may be work"."""
