"""Renders the camera's picture of the track, its walls and the sky."""
