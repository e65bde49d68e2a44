"""Text in comments of exported files."""


def comment(text: str) -> str:
    """Text that ends no comment of C and no line."""
    return " ".join(text.replace("*/", "* /").split())
