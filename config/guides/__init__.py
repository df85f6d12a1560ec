"""The guides of docs/ as pages of the site, in every language of it."""
