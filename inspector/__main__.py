"""`python -m inspector` is `inspector`."""

import sys

try:
    from inspector.cli import main

    main()
except KeyboardInterrupt:  # while modules are loaded; afterwards, the command line sees to it
    sys.exit(130)
