"""The equations solved: linearised along arcs, damped Gauss-Newton, segments halved."""
