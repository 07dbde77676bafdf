"""The commands of `inspector`, a module for each panel of its help, and what they share."""
