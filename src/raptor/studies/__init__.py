"""What simulations and surrogates are asked: evaluation, sweeps, speed against accuracy, active learning."""
