"""What was found held against what is expected, and against an earlier run."""
