"""The one exception for what a user can mend."""


class RaptorError(ValueError):
    """Bad input: the message says what is wrong, where, what is allowed and what to do."""
