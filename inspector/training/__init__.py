"""Models trained and evaluated on files: training, grid search, evaluation."""
