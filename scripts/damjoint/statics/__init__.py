"""Methods beside the finite elements: gravity method, limit analysis, what a failure is called."""
