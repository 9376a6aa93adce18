"""Figures. Each function draws a new figure from plain data; `save` writes it, and `plot` chooses one.

Names are those of `__init__.pyi`; each is imported on first use, so that no figure loads another's libraries.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
