"""An extremal as an answer like any other."""
