"""Files as text: strict YAML, where everything stands, and complaints that show it."""
