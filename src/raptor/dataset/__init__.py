"""Data sets: campaigns, shards of simulations, field stacks, examples, scaling, cards, checks."""
