"""What held a task back in a tick, and what letting go would give."""
