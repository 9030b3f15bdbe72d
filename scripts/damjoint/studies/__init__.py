"""What is done with many runs: sweeps, benchmarks; and a joint law along a path."""
