"""The sources' equations, tables and numbers, worked out by the library and by the examples.

An example's scripts import one another by name, as scripts of one folder do; here they are found the same way.
"""

import site
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "examples"

for _folder in ("heated_block", "quadruped", "reinforcement", "u8_thesis", "u8_trade"):
    site.addsitedir(str(EXAMPLES / _folder))
