"""The loading followed step by step: Newton's method, load stepping, equilibrium path, history."""
