"""Many tissues at once, in torch: the contraction of `raptor.condor.contract` for a GPU.

Same physics, same steps, same walls and tolerances as the compiled solver for one tissue; single
precision. Needs torch, and is imported only where it is asked for.
"""
