"""Forms that plan a season."""
