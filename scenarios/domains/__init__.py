"""Wide domains: robots, motions, drives, sensing and faults, drawn by a seed."""
