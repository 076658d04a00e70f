"""What stands beside Lightning: states, limits, processes, tables of losses."""
