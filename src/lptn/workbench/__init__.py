"""The workbench: a study as a page in the browser of this machine.

The room has some 3,400 lines, not 2,500: it begins with logs (`desk.py`), and holds what `lptn check` says of one
(`log_content.py`), for command and page alike.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
