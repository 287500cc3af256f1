"""What holds along an extremal of a structure: Pontryagin's system as equations."""
