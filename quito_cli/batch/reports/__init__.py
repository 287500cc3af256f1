"""What became of a run, told: a Report, and what is written of it."""
