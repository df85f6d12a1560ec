"""Accounts of programs: made by admins, with an owner and tokens of limited scopes and life."""
