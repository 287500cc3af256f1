"""The web page: solve by clicking. What it stands on is here too, and needs no browser."""
