"""Solution -> matplotlib Figure."""
