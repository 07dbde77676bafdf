"""Commands, recordings and reports for people."""
