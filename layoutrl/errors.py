"""The one error that is the user's to mend."""


class InputError(ValueError):
    """What the user gave cannot be used; the message says what, where, and how to mend it."""
