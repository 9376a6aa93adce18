"""How fast the simulator is, against baselines in the same run: `python -m benchmarks`."""
