"""python3 -m spherecut.sweep"""

import sys

from .command import main

sys.exit(main(sys.argv[1:]))
