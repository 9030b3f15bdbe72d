"""Finite elements of the bodies: functions, stiffness, factorisation, condensation."""
