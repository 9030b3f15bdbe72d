"""Methods beside the finite elements: gravity method, limit analysis, verdict of a run."""
