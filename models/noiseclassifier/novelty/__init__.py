"""Good runs alone: a baseline of them, and a general model that is adapted to them."""
