"""Personal data: every column that names or belongs to a person, what deleting an account does to it, and whether the
racer's download has it.

Each room has its rules in its module ``personal_data``, which is loaded when they are needed. A test walks all models
and refuses a column without a rule."""
