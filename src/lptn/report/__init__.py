"""Reports: sentences, tables, figures, and self-contained HTML pages of searches, comparisons, forecasts and plans.

A large room, since it says the same in three media: sentences and tables (`narrative`, `tables`, `text`) for terminal,
workbench and page; stills for paper and notebooks (`*_figures`); charts to zoom and the drawing of a network (`charts`,
`story_charts`, `planning_pages`, `network_*`) for the screen. Each takes about a third of it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
