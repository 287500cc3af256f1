"""Many solves: suites with expectations, sweeps, baselines, reports."""
