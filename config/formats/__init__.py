"""How dates are written: 2026-11-30 18:00, in every language and on the admin's pages too."""
