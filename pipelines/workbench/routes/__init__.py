"""The pages: each module has a ``router``, and is found by itself; HEADING and ORDER put it into the navigation."""
