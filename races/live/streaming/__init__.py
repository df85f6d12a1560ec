"""Chunks of positions and camera frames that spectators of a live event receive."""
