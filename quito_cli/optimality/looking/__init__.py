"""An answer looked at through Pontryagin's system: all that its conditions are judged by."""
