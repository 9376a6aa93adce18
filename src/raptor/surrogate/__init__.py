"""The surrogate: networks that predict the eight fields from a mould and three parameters."""

import os

# Before torch is loaded: its threads, while they wait for each other, must sleep and not spin. Where
# processors are shared, spinning made a prediction take 30 times as long.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
