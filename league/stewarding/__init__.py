"""Official results, and their corrections by stewards."""
