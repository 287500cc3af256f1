"""A suite file -> Suite: the cases to solve, each with what is expected of it."""
