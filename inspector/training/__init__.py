"""Training, evaluation and tuning of models on files."""
