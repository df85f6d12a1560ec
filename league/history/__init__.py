"""Import and export of seasons as folders in the old service's form: ``races.csv`` and a results file for each race."""
