"""The one exception for errors that a user can correct."""


class RaptorError(ValueError):
    """Bad input; the message says what is wrong, where, what is allowed and what to do."""
