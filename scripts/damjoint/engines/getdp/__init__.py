"""The plain engine: GetDP runs the problem definition, pro/damjoint.pro."""
