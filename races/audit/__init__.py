"""Reading the audit log: a page for admins, one for organisers of a race, the API and exports."""
