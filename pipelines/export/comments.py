"""Text in comments of exported files."""


def comment(text: str) -> str:
    """Text that cannot end a C comment or a line."""
    return " ".join(text.replace("*/", "* /").split())
