"""Base of every room's API: errors, pagination, limits."""
