"""Many tissues at once, in torch: the contraction of `raptor.condor.contract` for a GPU.

The same physics, steps, walls and tolerances as the compiled solver for one tissue, in single precision.
Needs torch, so it is imported only on request. Tested on processors; never yet run or measured on a GPU.
"""
