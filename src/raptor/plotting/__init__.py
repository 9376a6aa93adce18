"""Figures. Each function draws onto a new figure from plain data; `save` writes it, and `plot` knows which.

Names are those of `__init__.pyi`; each is imported when it is first used, so that no figure waits for
another's libraries.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
