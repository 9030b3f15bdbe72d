"""Tools that stand on the package: benchmarks, random verification, pages made from the code."""
