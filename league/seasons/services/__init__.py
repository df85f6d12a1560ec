"""Every write to seasons and their rounds."""
