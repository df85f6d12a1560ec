"""The audit log: what admins, stewards and organisers did, written in the transaction of the act."""
