"""Models trained and evaluated on files: training, baselines, grid search, evaluation."""
