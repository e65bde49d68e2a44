"""The page: temporary."""


def render(run):
    return "<html></html>"
