"""`python -m conespot` is the command `campaign`."""

import sys

from conespot.campaigns.command import main

sys.exit(main())
