"""The lessons of "Learn" and their pages."""
