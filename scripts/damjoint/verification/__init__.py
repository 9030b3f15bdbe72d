"""Published tests, which `damjoint validate` runs; no other command loads them."""
