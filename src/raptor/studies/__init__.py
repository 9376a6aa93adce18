"""Studies of simulations and surrogates: evaluation, sweeps, speed against accuracy, active learning."""
