"""The pages: each module has a ``router``, and is discovered; HEADING and ORDER place it in the navigation."""
