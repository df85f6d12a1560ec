"""Log-in by a provider: OpenID Connect or LDAP. Its applications are installed only where a provider is set."""
