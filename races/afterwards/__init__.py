"""What is left of a race when it is over: figures of its live event, results as CSV and PDF, certificates."""
