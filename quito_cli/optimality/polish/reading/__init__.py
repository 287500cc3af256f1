"""A direct answer read: its trajectories and multipliers, and the structure that it shows."""
