"""`python -m fdnet` is `fdnet`."""

from fdnet.cli import main

raise SystemExit(main())
