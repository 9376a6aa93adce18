"""The data set: design, shards of simulations, field stack, examples, scaling, card, checks."""
