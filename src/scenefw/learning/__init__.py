"""Lightning modules, schedules, checkpoints."""
