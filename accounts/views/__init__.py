"""Pages of accounts: settings, tokens, signing up, how much of the site a racer has used."""
