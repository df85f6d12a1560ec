"""Students of assignments, and their marks as rows."""
