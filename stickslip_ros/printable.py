"""Text of others, made fit to be shown."""


def printable(text: str) -> str:
    """Return a text on one line, with what would steer a terminal shown as its escape sequence.

    So a name in somebody's bag or scenario cannot move the cursor, set the window's title, or
    pretend to be a line of ours.
    """
    if text.isprintable():
        return text
    return "".join(
        character if character.isprintable() else ascii(character)[1:-1] for character in text
    )
