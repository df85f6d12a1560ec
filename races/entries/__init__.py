"""Race entries, submissions, standings and permissions."""
