"""A racer's public profile and settings."""
