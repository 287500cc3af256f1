"""The Solution, its file, and the checks of an answer."""
