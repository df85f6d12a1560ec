"""The format of log lines and the filters of the log."""
