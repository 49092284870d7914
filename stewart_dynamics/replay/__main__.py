# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The program stewart_replay: ``python -m stewart_dynamics.replay``."""

import sys

from stewart_dynamics.replay import main

sys.exit(main())
