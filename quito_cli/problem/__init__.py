"""Text -> checked Problem -> symbolic Model."""
