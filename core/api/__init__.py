"""What every room's API shares: errors, pages, limits."""
