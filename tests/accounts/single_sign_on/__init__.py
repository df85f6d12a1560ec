"""Tests of a site with a provider and a directory; :mod:`tests.accounts.test_single_sign_on` runs them."""
