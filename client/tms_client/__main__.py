"""``python -m tms_client`` is ``tms``."""

import sys

from tms_client.cli import main

sys.exit(main())
