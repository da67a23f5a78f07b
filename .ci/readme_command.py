"""Print the n-th command of the README's `Two commands` section: CI runs what the reader types."""

import re
import sys
from pathlib import Path

readme = Path(__file__).parents[1] / "README.md"
section = readme.read_text(encoding="utf-8").partition("## Two commands")[2]
blocks = re.findall(r"```(?:sh|bash)\n(.*?)```", section, flags=re.DOTALL)
print(blocks[int(sys.argv[1]) - 1].strip())
