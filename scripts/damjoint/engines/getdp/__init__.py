"""The reference GetDP model: GetDP runs the problem definition, pro/damjoint.pro."""
