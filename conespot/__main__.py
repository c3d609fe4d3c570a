"""`python -m conespot` is the command `campaign`."""

import sys

from conespot.campaigns.command import main

if __name__ == "__main__":
    sys.exit(main())
