"""Time integration: the dam through a recorded earthquake, from the static state on."""
